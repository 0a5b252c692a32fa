// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_launch.hpp"

#include "trace/ray_tracer.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
// Hits that a ray keeps before it blends; private memory is dear on GPUs.
constexpr int kCpuPending = 256;
constexpr int kPending = 64;
// Fewer rays than this share too little for a sort to pay.
constexpr std::size_t kOrderedRays = 4096;

}  // namespace

BuildOptions ray_walk_build(const DeviceInfo& device, const TraceOptions& options, int lanes) {
  return BuildOptions()
      .define("PACKET", lanes)
      .define("PENDING", device.type == DeviceType::kCpu ? kCpuPending : kPending)
      .define("ADAPTIVE_RADIUS", options.adaptive_radius ? 1 : 0)
      .define("PEAK_ORDER", options.hit_order == HitOrder::kPeak ? 1 : 0);
}

RayOrder::RayOrder(Context& context) : context_(&context), sort_(context) {
  indices_ = Buffer<std::uint32_t>(context, 1, "ray order");
}

bool RayOrder::compute(const WideTree& tree, const Buffer<Ray>& rays, std::size_t count) {
  if (count < kOrderedRays || tree.levels() == 0) return false;
  indices_.ensure(*context_, count, "ray order");
  keys_.ensure(*context_, count, "ray keys");
  context_->kernel("trace/ray_order.cl", "ray_keys", BuildOptions().define("PACKET", tree.lanes()))
      .launch(Range::linear(count, kGroup), rays, static_cast<std::uint32_t>(count), tree.nodes(),
              tree.scene_node(), keys_, indices_);
  sort_.sort(keys_, indices_, count);
  return true;
}

}  // namespace raysplats
