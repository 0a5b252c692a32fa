// SPDX-License-Identifier: Apache-2.0
#include "comm/sparse_row.hpp"

#include <algorithm>
#include <bit>

namespace raysplats {
namespace {

bool is_zero(std::span<const float> block) {
  std::uint32_t bits = 0;
  for (const float number : block) bits |= std::bit_cast<std::uint32_t>(number);
  return bits == 0;
}

// With more numbers than this share of the row a copy without the zeros costs more than it saves.
constexpr double kMostPacked = 0.75;

}  // namespace

void SparseRow::begin(std::size_t size) {
  size_ = size;
  marks_.assign((blocks() + 63) / 64, 0);
}

std::size_t SparseRow::size_of(std::size_t block) const {
  return std::min(kBlock, size_ - block * kBlock);
}

std::size_t SparseRow::marked_numbers() const {
  std::size_t count = 0;
  for (const std::uint64_t word : marks_)
    count += kBlock * static_cast<std::size_t>(std::popcount(word));
  if (size_ > 0 && marked(blocks() - 1)) count -= kBlock - size_of(blocks() - 1);
  return count;
}

void SparseRow::pack(std::span<const float> row) {
  begin(row.size());
  const auto block_of = [&](std::size_t b) { return row.subspan(b * kBlock, size_of(b)); };
  for (std::size_t block = 0; block < blocks(); ++block) {
    const std::uint64_t there = is_zero(block_of(block)) ? 0 : 1;
    marks_[block / 64] |= there << block % 64;
  }
  const std::size_t count = marked_numbers();
  if (static_cast<double>(count) > kMostPacked * static_cast<double>(size_)) {
    for (std::size_t block = 0; block < blocks(); ++block)
      marks_[block / 64] |= std::uint64_t{1} << block % 64;
    outgoing_ = row;
    return;
  }
  if (room_.size() < count) room_.resize(count);
  auto at = room_.begin();
  for (std::size_t block = 0; block < blocks(); ++block) {
    if (marked(block)) at = std::ranges::copy(block_of(block), at).out;
  }
  outgoing_ = std::span(room_).first(count);
}

void SparseRow::expect(std::span<float> row) {
  begin(row.size());
  row_ = row;
}

void SparseRow::expect_numbers() {
  const std::size_t count = marked_numbers();
  if (count == size_) {
    incoming_ = row_;
    return;
  }
  if (room_.size() < count) room_.resize(count);
  incoming_ = std::span(room_).first(count);
}

void SparseRow::unpack() {
  if (incoming_.size() == size_) return;
  auto at = incoming_.begin();
  for (std::size_t block = 0; block < blocks(); ++block) {
    const std::span<float> here = row_.subspan(block * kBlock, size_of(block));
    if (marked(block)) {
      std::copy_n(at, here.size(), here.begin());
      at += static_cast<std::ptrdiff_t>(here.size());
    } else {
      std::ranges::fill(here, 0.0f);
    }
  }
}

}  // namespace raysplats
