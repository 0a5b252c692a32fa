// SPDX-License-Identifier: Apache-2.0
#include "bvh/lbvh.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "shared/tree_layout.h"

namespace raysplats {
namespace {

constexpr std::string_view kCurve = "bvh/curve.cl";
constexpr std::string_view kTree = "bvh/lbvh.cl";
constexpr std::string_view kLeafOrder = "bvh/leaf_order.cl";
constexpr std::string_view kLeafOrderGroup = "bvh/leaf_order_group.cl";
constexpr std::string_view kCost = "bvh/tree_cost.cl";
constexpr std::size_t kGroup = 64;
// Boxes ordered together by the surface area heuristic. Larger groups make a better tree but need
// more private memory, or on GPUs more work-items.
constexpr std::size_t kCpuOrderGroup = 256;
constexpr std::size_t kOrderGroup = 64;
constexpr int kTrailLanes = 4;
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

std::size_t ceil_div(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

}  // namespace

TreeForm tree_form(const DeviceInfo& device) {
  if (device.type != DeviceType::kCpu) return {kTrailLanes, true};
  TreeForm form;
  while (form.lanes < 16 && static_cast<std::uint32_t>(2 * form.lanes) <= device.float_vector_width)
    form.lanes *= 2;
  return form;
}

BuildOptions tree_build(const TreeForm& form) {
  return BuildOptions().define("LANES", form.lanes).define("TRAIL", form.trail ? 1 : 0);
}

Lbvh::Lbvh(Context& context, const TreeForm& form)
    : Lbvh(context, form, ChunkShape::for_device(context.device())) {}

Lbvh::Lbvh(Context& context, const TreeForm& form, const ChunkShape& shape)
    : context_(&context), form_(form), shape_(shape), sort_(context, shape) {
  if (form.lanes != kTrailLanes && (form.trail || (form.lanes != 8 && form.lanes != 16))) {
    throw UsageError(fmt::format("Arbitrary rays cannot be traced {} {} lanes: choose 4{}",
                                 form.trail ? "by a trail with" : "with", form.lanes,
                                 form.trail ? "" : ", 8 or 16"));
  }
  grid_ = Buffer<float>(context, 14, "tree grid");
  too_long_ = Buffer<std::uint32_t>(context, 1, "tree flag");
}

std::size_t Lbvh::bytes_per_box(const TreeForm& form) {
  // Code in two words and order. A node for every block but one in `lanes`.
  const auto children = static_cast<std::size_t>(form.lanes - 1);
  return 3 * sizeof(std::uint32_t) + RadixSort::kBytesPerPair +
         (RS_NODE_VECTORS * sizeof(float) + children - 1) / children;
}

std::size_t Lbvh::block_count() const {
  return ceil_div(count_, static_cast<std::size_t>(form_.lanes));
}

std::size_t Lbvh::padded_blocks() const {
  const auto lanes = static_cast<std::size_t>(form_.lanes);
  return ceil_div(block_count(), lanes) * lanes;
}

std::size_t Lbvh::order_group() const {
  return context_->device().type == DeviceType::kCpu ? kCpuOrderGroup : kOrderGroup;
}

Kernel Lbvh::kernel(std::string_view program, const char* name) const {
  // Only what a program reads: every other set of definitions is compiled again.
  BuildOptions build = program == kTree || program == kCost
                           ? tree_build(form_)
                           : BuildOptions().define("LANES", form_.lanes);
  if (program == kLeafOrder || program == kLeafOrderGroup) {
    build.define("GROUP", order_group());
  } else if (program != kTree) {
    build.define("GROUP", shape_.group_size);
  }
  return context_->kernel(std::string(program), name, build);
}

void Lbvh::order(const Buffer<RsAabb>& boxes, std::size_t count) {
  if (boxes.size() < count || count >= kMaxCount) {
    throw UsageError(
        fmt::format("A tree over {} boxes needs a buffer of as many and at most 2^31, it has {}",
                    count, boxes.size()));
  }
  // Where this throws, the tree is empty.
  count_ = 0;
  level_sizes_.clear();
  const auto lanes = static_cast<std::size_t>(form_.lanes);
  std::vector<std::size_t> level_sizes;
  std::vector<std::uint32_t> begin{0};
  std::size_t nodes = 0;
  for (std::size_t size = ceil_div(count, lanes); count > 0;) {
    size = ceil_div(size, lanes);
    level_sizes.push_back(size);
    begin.push_back(u32(nodes));
    nodes += size;
    if (size == 1) break;
  }
  level_begin_.ensure(*context_, begin.size(), "tree levels");
  level_begin_.upload(begin);
  nodes_.ensure(*context_, (nodes + 1) * RS_NODE_VECTORS * lanes, "tree nodes");
  if (count > 0) sort_along_curve(boxes, count);
  scene_node_ = u32(nodes);
  level_sizes_ = std::move(level_sizes);
  count_ = count;
}

void Lbvh::sort_along_curve(const Buffer<RsAabb>& boxes, std::size_t count) {
  const auto lanes = static_cast<std::size_t>(form_.lanes);
  high_.ensure(*context_, count, "tree codes, high words");
  low_.ensure(*context_, count, "tree codes, low words");
  order_.ensure(*context_, count, "tree order");
  const std::size_t groups = shape_.used_groups(count);
  partials_.ensure(*context_, groups, "tree partial bounds");
  kernel(kCurve, "center_bounds")
      .launch(Range::linear(groups * shape_.group_size, shape_.group_size), boxes, partials_,
              u32(count), u32(shape_.chunk(count)));
  kernel(kCurve, "choose_grid")
      .launch(Range::linear(shape_.group_size, shape_.group_size), boxes, partials_, u32(count),
              u32(groups), grid_);
  const Range curve = Range::linear(ceil_div(count, lanes), kGroup);
  Kernel codes = kernel(kCurve, "curve_codes");
  codes.launch(curve, boxes, grid_, high_, low_, order_, u32(count));
  // Low words matter only where high words are equal, and there are few of those: half the passes.
  sort_.sort(high_, order_, count);
  too_long_.clear();
  const bool cpu = context_->device().type == DeviceType::kCpu;
  const std::size_t chunk = cpu ? shape_.chunk(count) : 1;
  kernel(kCurve, "sort_runs")
      .launch(Range::linear(ceil_div(count, chunk), cpu ? 1 : kGroup), high_, low_, order_,
              too_long_, u32(count), u32(chunk));
  if (too_long_.read(0) != 0) {
    // Many centres in one cell of the high words: sort by both words, the low one first.
    scratch_.ensure(*context_, count, "tree codes");
    codes.launch(curve, boxes, grid_, scratch_, high_, order_, u32(count));
    sort_.sort(high_, order_, count);
    kernel(kCurve, "gather_words")
        .launch(Range::linear(count, kGroup), scratch_, order_, high_, u32(count));
    sort_.sort(high_, order_, count);
  }
  if (cpu) {
    kernel(kLeafOrder, "order_leaves")
        .launch(Range::linear(ceil_div(count, order_group()), 1), boxes, order_, u32(count));
  } else {
    kernel(kLeafOrderGroup, "order_leaves_group")
        .launch(Range::linear(count, order_group()), boxes, order_, u32(count));
  }
}

void Lbvh::merge() {
  const auto lanes = static_cast<std::size_t>(form_.lanes);
  Kernel merge = kernel(kTree, "merge_nodes");
  std::size_t source = 0;
  for (const std::size_t size : level_sizes_) {
    merge.launch(Range::linear(ceil_div(size, lanes) * lanes, kGroup), nodes_, u32(source),
                 u32(size), u32(source + size));
    source += size;
  }
}

double Lbvh::cost(const Buffer<RsAabb>& boxes) {
  if (boxes.size() < count_) {
    throw UsageError(
        fmt::format("The cost of a tree over {} boxes cannot be told of {}", count_, boxes.size()));
  }
  if (count_ == 0) return 0;
  const auto sum = [&](const char* name, const auto& source, std::size_t count) {
    const std::size_t groups = shape_.used_groups(count);
    areas_.ensure(*context_, groups, "tree areas");
    kernel(kCost, name)
        .launch(Range::linear(groups * shape_.group_size, shape_.group_size), source, grid_, areas_,
                u32(count), u32(shape_.chunk(count)));
    std::vector<float> parts(groups);
    areas_.download(std::span<float>(parts));
    double total = 0;
    for (const float part : parts) total += static_cast<double>(part);
    return total;
  };
  const double leaves = sum("sum_box_areas", boxes, count_);
  return leaves > 0 ? sum("sum_node_areas", nodes_, scene_node_) / leaves : 0;
}

}  // namespace raysplats
