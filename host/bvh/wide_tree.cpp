// SPDX-License-Identifier: Apache-2.0
#include "bvh/wide_tree.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "bvh/wide_tree.cl";
constexpr std::size_t kGroup = 64;
constexpr std::size_t kNodeVectors = 6;  // RS_NODE_VECTORS
// Boxes ordered together by the surface area heuristic. Larger groups make a better tree but need
// more private memory.
constexpr std::size_t kCpuOrderGroup = 256;
constexpr std::size_t kOrderGroup = 64;
constexpr std::size_t kMaxPartials = 512;

std::uint32_t u32(std::size_t value) { return static_cast<std::uint32_t>(value); }

std::size_t ceil_div(std::size_t a, std::size_t b) { return (a + b - 1) / b; }

}  // namespace

int ray_lanes(const DeviceInfo& device, int lanes) {
  if (lanes == 0) {
    lanes = 4;
    while (device.type == DeviceType::kCpu && lanes < 16 &&
           static_cast<std::uint32_t>(2 * lanes) <= device.float_vector_width)
      lanes *= 2;
  }
  if (lanes != 4 && lanes != 8 && lanes != 16) {
    throw UsageError(
        fmt::format("Arbitrary rays cannot be traced with {} lanes: choose 4, 8 or 16", lanes));
  }
  return lanes;
}

WideTree::WideTree(Context& context, int lanes)
    : context_(&context), lanes_(ray_lanes(context.device(), lanes)), sort_(context) {
  grid_ = Buffer<float>(context, 4, "tree grid");
}

std::size_t WideTree::block_count() const {
  return ceil_div(count_, static_cast<std::size_t>(lanes_));
}

std::size_t WideTree::padded_blocks() const {
  const auto lanes = static_cast<std::size_t>(lanes_);
  return ceil_div(block_count(), lanes) * lanes;
}

void WideTree::order(const Buffer<RsAabb>& boxes, std::size_t count) {
  count_ = count;
  const auto lanes = static_cast<std::size_t>(lanes_);
  level_sizes_.clear();
  std::vector<std::uint32_t> begin{0};
  std::size_t nodes = 0;
  for (std::size_t size = block_count(); count_ > 0;) {
    size = ceil_div(size, lanes);
    level_sizes_.push_back(size);
    begin.push_back(u32(nodes));
    nodes += size;
    if (size == 1) break;
  }
  level_begin_.ensure(*context_, begin.size(), "tree levels");
  level_begin_.upload(begin);
  scene_node_ = u32(nodes);
  nodes_.ensure(*context_, (nodes + 1) * kNodeVectors * lanes, "tree nodes");
  if (count_ > 0) sort_along_curve(boxes);
}

void WideTree::sort_along_curve(const Buffer<RsAabb>& boxes) {
  const auto lanes = static_cast<std::size_t>(lanes_);
  high_.ensure(*context_, count_, "tree codes, high words");
  low_.ensure(*context_, count_, "tree codes, low words");
  order_.ensure(*context_, count_, "tree order");
  const bool cpu = context_->device().type == DeviceType::kCpu;
  const std::size_t order_group = cpu ? kCpuOrderGroup : kOrderGroup;
  const BuildOptions build = BuildOptions().define("PACKET", lanes_).define("GROUP", order_group);
  const std::size_t chunk = std::max<std::size_t>(1, ceil_div(count_, kMaxPartials));
  const std::size_t chunks = ceil_div(count_, chunk);
  partials_.ensure(*context_, chunks, "tree partial bounds");
  context_->kernel(kProgram, "bound_centers", build)
      .launch(Range::linear(chunks, 1), boxes, partials_, u32(count_), u32(chunk));
  context_->kernel(kProgram, "finish_grid", build).launch(Range{}, partials_, u32(chunks), grid_);
  const Range curve = Range::linear(ceil_div(count_, lanes), kGroup);
  context_->kernel(kProgram, "hilbert_codes", build)
      .launch(curve, boxes, grid_, high_, low_, order_, u32(count_));
  // By both words, the low one first.
  sort_.sort(low_, order_, count_);
  context_->kernel(kProgram, "gather_codes", build)
      .launch(Range::linear(count_, kGroup), high_, order_, low_, u32(count_));
  sort_.sort(low_, order_, count_);
  context_->kernel(kProgram, "order_groups", build)
      .launch(Range::linear(ceil_div(count_, order_group), cpu ? 1 : kGroup), boxes, order_,
              u32(count_));
}

void WideTree::merge() {
  const auto lanes = static_cast<std::size_t>(lanes_);
  Kernel merge = context_->kernel(kProgram, "merge_nodes", BuildOptions().define("PACKET", lanes_));
  std::size_t source = 0;
  for (const std::size_t size : level_sizes_) {
    merge.launch(Range::linear(ceil_div(size, lanes) * lanes, kGroup), nodes_, u32(source),
                 u32(size), u32(source + size));
    source += size;
  }
}

}  // namespace raysplats
