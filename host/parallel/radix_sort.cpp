// SPDX-License-Identifier: Apache-2.0
#include "parallel/radix_sort.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "parallel/radix_sort.cl";
constexpr std::size_t kDigits = 256;
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

}  // namespace

RadixSort::RadixSort(Context& context)
    : RadixSort(context, ChunkShape::for_device(context.device())) {}

RadixSort::RadixSort(Context& context, const ChunkShape& shape)
    : context_(&context), shape_(shape), all_(context, 1, "all to sort") {
  all_.fill(0xffffffffu);
}

// Which of the programs a sort takes depends on its number of passes.
void RadixSort::require_kernels(bool from_pairs, bool to_pairs) {
  Kernel& scatter = scatter_[from_pairs][to_pairs];
  if (scatter) return;
  const BuildOptions options = BuildOptions()
                                   .define("GROUP", shape_.group_size)
                                   .define("RS_SOURCE_PAIRS", from_pairs ? 1 : 0)
                                   .define("RS_TARGET_PAIRS", to_pairs ? 1 : 0);
  scatter = context_->kernel(kProgram, "scatter", options);
  Kernel& count_digits = count_digits_[from_pairs];
  if (!count_digits) count_digits = context_->kernel(kProgram, "count_digits", options);
  if (!scan_counts_) scan_counts_ = context_->kernel(kProgram, "scan_counts", options);
}

void RadixSort::begin_programs(int bits) {
  const int passes = (bits + 7) / 8;
  for (int i = 0; i < passes; ++i) require_kernels(i > 0, i + 1 < passes);
}

void RadixSort::sort(Buffer<std::uint32_t>& keys,
                     Buffer<std::uint32_t>& values,
                     std::size_t count,
                     int bits) {
  sort(keys, values, all_, count, bits);
}

void RadixSort::sort(Buffer<std::uint32_t>& keys,
                     Buffer<std::uint32_t>& values,
                     const Buffer<std::uint32_t>& live,
                     std::size_t most,
                     int bits) {
  if (most >= kMaxCount || keys.size() < most || values.size() < most || bits < 0 || bits > 32) {
    throw UsageError(
        fmt::format("Cannot sort {} pairs by {} bits in buffers of {} keys and {} values: at most "
                    "2^31 pairs and 32 bits",
                    most, bits, keys.size(), values.size()));
  }
  if (most < 2 || bits == 0) return;
  const int passes = (bits + 7) / 8;
  // A kernel cannot take no buffer: those that a pass does not use are one element long.
  pairs_[0].ensure(*context_, passes > 1 ? most : 1, "sort pairs");
  pairs_[1].ensure(*context_, passes > 2 ? most : 1, "sort pairs");
  if (passes == 1) {
    keys_.ensure(*context_, most, "sort keys");
    values_.ensure(*context_, most, "sort values");
    pass({keys, values, pairs_[0], keys_, values_, pairs_[1]}, false, false, live, most, 0);
    keys.copy_from(keys_, most);
    values.copy_from(values_, most);
    return;
  }
  for (int i = 0; i < passes; ++i) {
    Buffer<Pair>& from = pairs_[(i + 1) % 2];
    Buffer<Pair>& to = pairs_[i % 2];
    pass({keys, values, from, keys, values, to}, i > 0, i + 1 < passes, live, most, 8 * i);
  }
}

void RadixSort::pass(const Ends& ends,
                     bool from_pairs,
                     bool to_pairs,
                     const Buffer<std::uint32_t>& live,
                     std::size_t most,
                     int bit) {
  require_kernels(from_pairs, to_pairs);
  const std::size_t groups = shape_.used_groups(most);
  const auto limit = static_cast<std::uint32_t>(most);
  const auto least = static_cast<std::uint32_t>(shape_.min_chunk);
  const auto shift = static_cast<std::uint32_t>(bit);
  const Range range = Range::linear(groups * shape_.group_size, shape_.group_size);
  counts_.ensure(*context_, kDigits * groups, "sort digit counts");
  totals_.ensure(*context_, kDigits, "sort digit totals");
  count_digits_[from_pairs].launch(range, ends.keys, ends.pairs, counts_, live, limit, least,
                                   shift);
  const std::size_t scans =
      shape_.group_size > 1 ? kDigits : std::min(kDigits, shape_.used_groups(kDigits * groups));
  scan_counts_.launch(Range::linear(scans * shape_.group_size, shape_.group_size), counts_, totals_,
                      static_cast<std::uint32_t>(groups));
  scatter_[from_pairs][to_pairs].launch(range, ends.keys, ends.values, ends.pairs, counts_, totals_,
                                        ends.keys_out, ends.values_out, ends.pairs_out, live, limit,
                                        least, shift);
}

}  // namespace raysplats
