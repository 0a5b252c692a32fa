// SPDX-License-Identifier: Apache-2.0
#include "parallel/scan.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "parallel/scan.cl";
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

}  // namespace

Scan::Scan(Context& context) : Scan(context, ChunkShape::for_device(context.device())) {}

Scan::Scan(Context& context, const ChunkShape& shape) : context_(&context), shape_(shape) {
  const BuildOptions options = BuildOptions().define("GROUP", shape.group_size);
  sum_chunks_ = context.kernel(kProgram, "sum_chunks", options);
  scan_values_ = context.kernel(kProgram, "scan_values", options);
}

void Scan::exclusive(Buffer<std::uint32_t>& values, std::size_t count) {
  if (count >= kMaxCount || values.size() < count + 1) {
    throw UsageError(
        fmt::format("A scan of {} elements needs a buffer of one more and at most 2^31, it has {}",
                    count, values.size()));
  }
  const std::size_t chunk = shape_.chunk(count);
  const std::size_t groups = shape_.used_groups(count);
  const auto n = static_cast<std::uint32_t>(count);
  const auto step = static_cast<std::uint32_t>(chunk);
  sums_.ensure(*context_, groups, "scan sums");
  const Range range = Range::linear(groups * shape_.group_size, shape_.group_size);
  if (groups > 1) sum_chunks_.launch(range, values, sums_, n, step);
  scan_values_.launch(range, values, sums_, n, step);
}

}  // namespace raysplats
