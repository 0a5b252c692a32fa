// SPDX-License-Identifier: Apache-2.0
#include "primitives/radix_sort.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "primitives/radix_sort.cl";
constexpr std::size_t kDigits = 256;
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

}  // namespace

RadixSort::RadixSort(Context& context)
    : RadixSort(context, ChunkShape::for_device(context.device())) {}

RadixSort::RadixSort(Context& context, const ChunkShape& shape)
    : context_(&context), shape_(shape), scan_(context, shape) {
  const BuildOptions options = BuildOptions().define("RS_GROUP", shape.group_size);
  count_digits_ = context.kernel(kProgram, "count_digits", options);
  scatter_pairs_ = context.kernel(kProgram, "scatter_pairs", options);
}

void RadixSort::sort(Buffer<std::uint32_t>& keys,
                     Buffer<std::uint32_t>& values,
                     std::size_t count,
                     int bits) {
  if (count >= kMaxCount || keys.size() < count || values.size() < count || bits < 0 || bits > 32) {
    throw UsageError(
        fmt::format("Cannot sort {} pairs by {} bits in buffers of {} keys and {} values: at most "
                    "2^31 pairs and 32 bits",
                    count, bits, keys.size(), values.size()));
  }
  if (count < 2) return;
  keys_.ensure(*context_, count, "sort keys");
  values_.ensure(*context_, count, "sort values");
  bool in_scratch = false;
  for (int bit = 0; bit < bits; bit += 8) {
    const auto shift = static_cast<std::uint32_t>(bit);
    if (in_scratch) {
      pass(keys_, values_, keys, values, count, shift);
    } else {
      pass(keys, values, keys_, values_, count, shift);
    }
    in_scratch = !in_scratch;
  }
  if (in_scratch) {
    keys.copy_from(keys_, count);
    values.copy_from(values_, count);
  }
}

void RadixSort::pass(const Buffer<std::uint32_t>& keys,
                     const Buffer<std::uint32_t>& values,
                     Buffer<std::uint32_t>& keys_out,
                     Buffer<std::uint32_t>& values_out,
                     std::size_t count,
                     std::uint32_t shift) {
  const std::size_t groups = shape_.used_groups(count);
  const auto n = static_cast<std::uint32_t>(count);
  const auto chunk = static_cast<std::uint32_t>(shape_.chunk(count));
  const Range range = Range::linear(groups * shape_.group_size, shape_.group_size);
  table_.ensure(*context_, kDigits * groups + 1, "sort digit table");
  count_digits_.launch(range, keys, table_, n, chunk, shift);
  scan_.exclusive(table_, kDigits * groups);
  scatter_pairs_.launch(range, keys, values, table_, keys_out, values_out, n, chunk, shift);
}

}  // namespace raysplats
