// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raysplats {

/// A row of numbers as it goes among ranks: without its blocks of zeros. A view says nothing of
/// Gaussians that it does not meet, so most numbers of its gradient may be such. Where they are few
/// the row goes as it is, without a copy. Numbers come out with the bits that they went in with: a
/// block with a -0 is sent.
class SparseRow {
 public:
  static constexpr std::size_t kBlock = 16;  ///< numbers; a line of a processor's cache

  /// Takes the blocks of `row`, which has to last until they are sent, that are not all +0.
  void pack(std::span<const float> row);
  /// For one that comes: into `row`, after marks().
  void expect(std::span<float> row);
  /// After the marks have come: makes room for incoming().
  void expect_numbers();
  /// After the numbers have come: writes the row, zeros included.
  void unpack();

  /// A bit for every block, whether it is there.
  std::span<std::uint64_t> marks() { return marks_; }
  /// What is there, block after block; the last block of a row is as short as that leaves it.
  std::span<const float> outgoing() const { return outgoing_; }
  std::span<float> incoming() { return incoming_; }

 private:
  void begin(std::size_t size);
  std::size_t blocks() const { return (size_ + kBlock - 1) / kBlock; }
  std::size_t size_of(std::size_t block) const;
  bool marked(std::size_t block) const { return (marks_[block / 64] >> block % 64 & 1) != 0; }
  std::size_t marked_numbers() const;

  std::size_t size_ = 0;
  std::vector<std::uint64_t> marks_;
  std::vector<float> room_;  // for rows with gaps
  std::span<const float> outgoing_;
  std::span<float> row_, incoming_;
};

}  // namespace raysplats
