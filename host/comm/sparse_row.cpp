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

}  // namespace

std::size_t SparseRow::size_of(std::size_t block) const {
  return std::min(kBlock, size_ - block * kBlock);
}

void SparseRow::pack(std::span<const float> row) {
  expect(row.size());
  count_ = 0;
  if (numbers_.size() < size_) numbers_.resize(size_);
  for (std::size_t block = 0; block < blocks(); ++block) {
    const std::span<const float> here = row.subspan(block * kBlock, size_of(block));
    if (is_zero(here)) continue;
    marks_[block / 64] |= std::uint64_t{1} << block % 64;
    std::ranges::copy(here, numbers_.begin() + static_cast<std::ptrdiff_t>(count_));
    count_ += here.size();
  }
}

void SparseRow::expect(std::size_t size) {
  size_ = size;
  marks_.assign((blocks() + 63) / 64, 0);
}

void SparseRow::expect_numbers() {
  count_ = 0;
  for (const std::uint64_t word : marks_)
    count_ += kBlock * static_cast<std::size_t>(std::popcount(word));
  if (size_ > 0 && marked(blocks() - 1)) count_ -= kBlock - size_of(blocks() - 1);
  if (numbers_.size() < count_) numbers_.resize(count_);
}

void SparseRow::unpack(std::span<float> row) const {
  std::size_t at = 0;
  for (std::size_t block = 0; block < blocks(); ++block) {
    const std::span<float> here = row.subspan(block * kBlock, size_of(block));
    if (marked(block)) {
      std::copy_n(numbers_.begin() + static_cast<std::ptrdiff_t>(at), here.size(), here.begin());
      at += here.size();
    } else {
      std::ranges::fill(here, 0.0f);
    }
  }
}

}  // namespace raysplats
