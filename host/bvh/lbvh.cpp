// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kMortonProgram = "bvh/morton.cl";
constexpr const char* kHierarchyProgram = "bvh/hierarchy.cl";
constexpr const char* kCostProgram = "bvh/tree_cost.cl";
// Leaves per block of the box tree; chunks are multiples of it.
constexpr std::size_t kSequentialBlock = 16;
constexpr std::size_t kParallelBlock = 8;
constexpr std::size_t kGroup = 64;
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

std::uint32_t u32(std::size_t value) { return static_cast<std::uint32_t>(value); }

}  // namespace

Lbvh::Lbvh(Context& context) : Lbvh(context, ChunkShape::for_device(context.device())) {}

Lbvh::Lbvh(Context& context, const ChunkShape& shape)
    : context_(&context), shape_(shape), sort_(context, shape) {
  const BuildOptions grouped = BuildOptions().define("RS_GROUP", shape.group_size);
  center_bounds_ = context.kernel(kMortonProgram, "center_bounds", grouped);
  choose_grid_ = context.kernel(kMortonProgram, "choose_grid", grouped);
  morton_codes_ = context.kernel(kMortonProgram, "morton_codes", grouped);
  sort_runs_ = context.kernel(kMortonProgram, "sort_runs", grouped);
  gather_words_ = context.kernel(kMortonProgram, "gather_words", grouped);
  const BuildOptions hierarchy = BuildOptions().define("RS_BLOCK", block());
  compute_deltas_ = context.kernel(kHierarchyProgram, "compute_deltas", hierarchy);
  build_chunks_ = context.kernel(kHierarchyProgram, "build_chunks", hierarchy);
  bound_blocks_ = context.kernel(kHierarchyProgram, "bound_blocks", hierarchy);
  merge_blocks_ = context.kernel(kHierarchyProgram, "merge_blocks", hierarchy);
  find_spanning_ = context.kernel(kHierarchyProgram, "find_spanning", hierarchy);
  bound_spanning_ = context.kernel(kHierarchyProgram, "bound_spanning", hierarchy);
  sum_areas_ = context.kernel(kCostProgram, "sum_areas", grouped);
  grid_ = Buffer<float>(context, 14, "bvh grid");
  too_long_ = Buffer<std::uint32_t>(context, 1, "bvh flag");
}

std::size_t Lbvh::block() const { return sequential() ? kSequentialBlock : kParallelBlock; }

std::size_t Lbvh::chunk() const {
  if (!sequential()) return 1;
  return (shape_.chunk(count_) + kSequentialBlock - 1) / kSequentialBlock * kSequentialBlock;
}

Range Lbvh::spread() const {
  const std::size_t items = (count_ + chunk() - 1) / chunk();
  return Range::linear(items, sequential() ? 1 : kGroup);
}

void Lbvh::build(const Buffer<RsAabb>& boxes, std::size_t count) {
  if (boxes.size() < count || count >= kMaxCount) {
    throw UsageError(fmt::format(
        "A hierarchy over {} boxes needs a buffer of as many and at most 2^31, it has {}", count,
        boxes.size()));
  }
  count_ = count;
  leaves_.ensure(*context_, count, "bvh leaves");
  nodes_.ensure(*context_, count > 0 ? count - 1 : 0, "bvh nodes");
  if (count == 0) return;
  sort_by_code(boxes);
  if (count == 1) return;
  delta_.ensure(*context_, count, "bvh deltas");
  compute_deltas_.launch(spread(), high_, low_, leaves_, delta_, u32(count), u32(chunk()));
  if (!sequential()) spanning_.clear();  // every split is pending
  bound_leaves(boxes, false);
  find_spanning_.launch(spread(), high_, low_, leaves_, delta_, nodes_, spanning_, u32(count),
                        u32(chunk()));
  bound_spanning(boxes);
}

void Lbvh::refit(const Buffer<RsAabb>& boxes) {
  if (boxes.size() < count_) {
    throw UsageError(
        fmt::format("A hierarchy over {} boxes cannot be refitted to {}", count_, boxes.size()));
  }
  if (count_ < 2) return;
  bound_leaves(boxes, true);
  bound_spanning(boxes);
}

double Lbvh::cost() {
  if (count_ < 2) return 0;
  const std::size_t count = count_ - 1;
  const std::size_t groups = shape_.used_groups(count);
  areas_.ensure(*context_, groups, "bvh areas");
  sum_areas_.launch(Range::linear(groups * shape_.group_size, shape_.group_size), nodes_, areas_,
                    u32(count), u32(shape_.chunk(count)));
  double inner = 0;
  double leaves = 0;
  for (const std::array<float, 2>& part : areas_.download()) {
    inner += static_cast<double>(part[0]);
    leaves += static_cast<double>(part[1]);
  }
  return leaves > 0 ? inner / leaves : 0;
}

void Lbvh::sort_by_code(const Buffer<RsAabb>& boxes) {
  high_.ensure(*context_, count_, "bvh codes, high words");
  low_.ensure(*context_, count_, "bvh codes, low words");
  spanning_.ensure(*context_, count_, "bvh splits");
  const std::size_t groups = shape_.used_groups(count_);
  const Range all = Range::linear(count_, kGroup);
  partials_.ensure(*context_, groups, "bvh partial bounds");
  center_bounds_.launch(Range::linear(groups * shape_.group_size, shape_.group_size), boxes,
                        partials_, u32(count_), u32(shape_.chunk(count_)));
  choose_grid_.launch(Range::linear(shape_.group_size, shape_.group_size), boxes, partials_,
                      u32(count_), u32(groups), grid_);
  morton_codes_.launch(spread(), boxes, grid_, high_, low_, leaves_, u32(count_), u32(chunk()));
  // Low words matter only where high words are equal, and there are few of those: half the passes.
  sort_.sort(high_, leaves_, count_);
  too_long_.clear();
  sort_runs_.launch(spread(), high_, low_, leaves_, too_long_, u32(count_), u32(chunk()));
  if (too_long_.read(0) == 0) return;
  // Many centres in one cell of the high words: sort by both words, the low one first.
  Buffer<std::uint32_t>& scratch = spanning_;
  morton_codes_.launch(spread(), boxes, grid_, scratch, high_, leaves_, u32(count_), u32(chunk()));
  sort_.sort(high_, leaves_, count_);
  gather_words_.launch(all, scratch, leaves_, high_, u32(count_));
  sort_.sort(high_, leaves_, count_);
}

void Lbvh::bound_leaves(const Buffer<RsAabb>& boxes, bool refit) {
  const std::size_t block_count = (count_ + block() - 1) / block();
  std::size_t total = block_count;
  for (std::size_t size = block_count; size > 1; size = (size + 1) / 2) total += (size + 1) / 2;
  blocks_.ensure(*context_, total, "bvh block bounds");
  if (sequential()) {
    build_chunks_.launch(spread(), boxes, leaves_, delta_, nodes_, spanning_, blocks_, u32(count_),
                         u32(chunk()), std::int32_t{refit});
  } else {
    bound_blocks_.launch(Range::linear(block_count, kGroup), boxes, leaves_, blocks_, u32(count_));
  }
  std::size_t source = 0;
  for (std::size_t size = block_count; size > 1; size = (size + 1) / 2) {
    merge_blocks_.launch(Range::linear((size + 1) / 2, kGroup), blocks_, u32(source), u32(size),
                         u32(source + size));
    source += size;
  }
}

void Lbvh::bound_spanning(const Buffer<RsAabb>& boxes) {
  bound_spanning_.launch(spread(), boxes, leaves_, blocks_, spanning_, nodes_, u32(count_),
                         u32(chunk()));
}

}  // namespace raysplats
