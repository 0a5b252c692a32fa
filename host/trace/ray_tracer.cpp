// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "trace/launch_budget.hpp"
#include "trace/memory_shares.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tree.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kRayBytes = sizeof(Ray) + sizeof(RayResult);
// On CPUs a work-item traces several rays one after the other: OpenCL implementations there give
// every work-item of a group its own private memory, which would not stay in the cache.
constexpr std::size_t kCpuRaysPerItem = 64;

// RsRayWalk::color_from_origin.
constexpr std::int32_t kFlagPerRay = 2;
std::int32_t color_mode(ColorDirection direction) {
  return direction == ColorDirection::kFromOrigin ? 1 : 0;
}

}  // namespace

struct RayTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in, const TreeForm& form)
      : context(context_in),
        options(options_in),
        tree(context_in, options_in, form),
        order(context_in),
        budget(options_in.launch_budget_ms, context_in.device().type),
        no_flags(context_in, 1, "no flags of rays"),
        no_cones(context_in, 1, "no cones") {}

  Context& context;
  TraceOptions options;
  RayNear near;
  RayTree tree;
  std::uint64_t revision = 0;  // of the Gaussians in it
  RayOrder order;
  LaunchBudget budget;
  Buffer<std::uint32_t> no_flags;
  Buffer<RsCone> no_cones;
  Buffer<Ray> rays;
  Buffer<RayResult> results;
  bool counts_work = false;
};

RayTracer::RayTracer(Context& context, const TraceOptions& options)
    : RayTracer(context, options, tree_form(context.device())) {}
RayTracer::RayTracer(Context& context, const TraceOptions& options, const TreeForm& form)
    : impl_(std::make_unique<Impl>(context, options, form)) {}
RayTracer::~RayTracer() = default;

void RayTracer::update(const DeviceGaussians& gaussians) {
  impl_->revision = 0;  // where this throws, the tree is of no model
  impl_->tree.build(gaussians);
  impl_->revision = gaussians.revision;
}

void RayTracer::refit(const DeviceGaussians& gaussians) {
  impl_->revision = 0;
  impl_->tree.refit(gaussians);
  impl_->revision = gaussians.revision;
}

bool RayTracer::follow(const DeviceGaussians& gaussians) {
  Impl& self = *impl_;
  if (self.revision > 0 && gaussians.revision == self.revision) return false;
  self.revision = 0;
  const bool built = self.tree.follow(gaussians);
  self.revision = gaussians.revision;
  return built;
}

void RayTracer::require_current(const DeviceGaussians& gaussians) const {
  if (impl_->tree.tree().size() != gaussians.count || impl_->revision != gaussians.revision) {
    throw UsageError("RayTracer::update() must follow every change of the Gaussians");
  }
}

void RayTracer::trace(const DeviceGaussians& gaussians,
                      const Buffer<Ray>& rays,
                      std::size_t count,
                      Buffer<RayResult>& results,
                      ColorDirection color_direction,
                      const Buffer<RsCone>* cones) {
  launch(gaussians, rays, count, results, color_mode(color_direction), impl_->no_flags, cones);
}

void RayTracer::trace(const DeviceGaussians& gaussians,
                      const Buffer<Ray>& rays,
                      const Buffer<std::uint32_t>& from_origin,
                      std::size_t count,
                      Buffer<RayResult>& results,
                      const Buffer<RsCone>* cones) {
  if (from_origin.size() < count) {
    throw UsageError(fmt::format("{} rays need as many flags, not {}", count, from_origin.size()));
  }
  launch(gaussians, rays, count, results, kFlagPerRay, from_origin, cones);
}

void RayTracer::launch(const DeviceGaussians& gaussians,
                       const Buffer<Ray>& rays,
                       std::size_t count,
                       Buffer<RayResult>& results,
                       std::int32_t color_mode,
                       const Buffer<std::uint32_t>& from_origin,
                       const Buffer<RsCone>* cones) {
  Impl& self = *impl_;
  require_current(gaussians);
  if (cones != nullptr && !has_cones(self.options))
    throw UsageError("Rays are cones only where there is a view_footprint: set it");
  if (cones != nullptr && cones->size() < count) {
    throw UsageError(fmt::format("{} rays need as many cones, not {}", count, cones->size()));
  }
  if (rays.size() < count) {
    throw UsageError(fmt::format("{} rays cannot be traced from a buffer of {}: pass a larger one",
                                 count, rays.size()));
  }
  if (results.size() < count) results.ensure(self.context, count, "ray results");
  const TraceOptions& options = self.options;
  const Lbvh& tree = self.tree.tree();
  const bool shares = shares_items(self.context.device(), tree.form());
  const bool ordered = self.order.compute(tree, rays, count);
  const std::size_t rays_per_item = shares ? kCpuRaysPerItem : 1;
  BuildOptions build = ray_walk_build(tree.form(), options, self.near, gaussians.active_sh_degree);
  if (self.counts_work) build.define("COUNT_WORK", 1);
  build.define("LEADING", color_mode == kFlagPerRay ? 1 : 0);
  RsRayWalk walk = ray_walk(options, self.near, gaussians, color_mode);
  walk.has_cones = cones != nullptr ? 1 : 0;
  Kernel kernel = self.context.kernel("trace/ray_tracer.cl", "trace_rays", build);
  const auto run = [&](const auto& kinds) {  // RS_RAY_KINDS
    launch_in_bands(self.context, self.budget, kernel, (count + rays_per_item - 1) / rays_per_item,
                    shares ? 1 : kGroup, u32(count), u32(rays_per_item), self.tree.arguments(),
                    gaussians.sh, walk, self.order.arguments(rays, ordered), kinds, results);
  };
  if (has_cones(options)) {
    run(argument_pack(from_origin, cones != nullptr ? *cones : self.no_cones));
  } else {
    run(argument_pack(from_origin));
  }
}

void RayTracer::count_work() { impl_->counts_work = true; }

void RayTracer::set_background(const std::array<float, 3>& background) {
  impl_->options.background = background;
}

void RayTracer::set_near(const RayNear& near) { impl_->near = near; }

void RayTracer::set_watch(std::function<void(double)> watch) {
  impl_->budget.set_watch(std::move(watch));
}

const RayNear& RayTracer::near() const { return impl_->near; }

const TraceOptions& RayTracer::options() const { return impl_->options; }

const RayTree& RayTracer::tree() const { return impl_->tree; }

std::vector<RayResult> RayTracer::trace(const DeviceGaussians& gaussians,
                                        std::span<const Ray> rays,
                                        ColorDirection color_direction) {
  Impl& self = *impl_;
  const std::size_t batch = std::max<std::size_t>(
      kGroup, std::min<std::size_t>(
                  MemoryShares(self.options, self.context.device()).host_rays() / kRayBytes,
                  self.context.device().max_allocation / sizeof(Ray)));
  std::vector<RayResult> out(rays.size());
  for (std::size_t begin = 0; begin < rays.size(); begin += batch) {
    const std::size_t count = std::min(batch, rays.size() - begin);
    self.rays.ensure(self.context, count, "rays");
    self.rays.upload(rays.subspan(begin, count));
    trace(gaussians, self.rays, count, self.results, color_direction);
    self.results.download(std::span<RayResult>(out).subspan(begin, count));
  }
  return out;
}

}  // namespace raysplats
