// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raysplats {

/// A row of numbers as it goes among ranks: without its blocks of zeros. A view says nothing of
/// Gaussians that it does not meet, so most numbers of its gradient may be such. Numbers come out
/// with the bits that they went in with: a block with a -0 is sent.
class SparseRow {
 public:
  static constexpr std::size_t kBlock = 16;  ///< numbers; a line of a processor's cache

  /// Takes the blocks of `row` that are not all +0.
  void pack(std::span<const float> row);
  /// Makes room for the blocks of a row of `size` numbers; marks() then come from elsewhere.
  void expect(std::size_t size);
  /// After the marks have come: the room for numbers().
  void expect_numbers();
  /// Writes the row, zeros included.
  void unpack(std::span<float> row) const;

  /// A bit for every block, whether it is there.
  std::span<std::uint64_t> marks() { return marks_; }
  /// What is there, block after block; the last block of a row is as short as that leaves it.
  std::span<float> numbers() { return std::span(numbers_).first(count_); }

 private:
  std::size_t blocks() const { return (size_ + kBlock - 1) / kBlock; }
  std::size_t size_of(std::size_t block) const;
  bool marked(std::size_t block) const { return (marks_[block / 64] >> block % 64 & 1) != 0; }

  std::size_t size_ = 0, count_ = 0;
  std::vector<std::uint64_t> marks_;
  std::vector<float> numbers_;  // room that has been of use, of which count_ are
};

}  // namespace raysplats
