// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tracer.hpp"

#include <algorithm>
#include <array>

#include "bvh/gaussian_bounds.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kRayBytes = sizeof(Ray) + sizeof(RayResult);
static_assert(sizeof(Ray) == 32 && sizeof(RayResult) == 32,
              "kernels read and write eight words a ray");

}  // namespace

struct RayTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in)
      : context(context_in), options(options_in), tree(context_in) {}

  Context& context;
  TraceOptions options;
  Lbvh tree;
  Buffer<RsAabb> boxes;
  Buffer<RsLine> records;
  Buffer<Ray> rays;
  Buffer<RayResult> results;
};

RayTracer::RayTracer(Context& context, const TraceOptions& options)
    : impl_(std::make_unique<Impl>(context, options)) {}
RayTracer::~RayTracer() = default;

void RayTracer::update(const DeviceGaussians& gaussians) {
  Impl& self = *impl_;
  const bool sigmoid = gaussians.activation == ScaleActivation::kSigmoid;
  GaussianBounds bounds(self.context, sigmoid, self.options.adaptive_radius);
  bounds.compute(gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
                 gaussians.count, self.options.quantile, self.boxes);
  self.tree.build(self.boxes, gaussians.count);
  self.records.ensure(self.context, gaussians.count, "ray records");
  BuildOptions build;
  build.define("SIGMOID_SCALE", sigmoid ? 1 : 0)
      .define("ADAPTIVE_RADIUS", self.options.adaptive_radius ? 1 : 0);
  Kernel prepare = self.context.kernel("trace/rays.cl", "prepare_rays", build);
  prepare.launch(Range::linear(gaussians.count, kGroup),
                 static_cast<std::uint32_t>(gaussians.count), gaussians.means,
                 gaussians.quaternions, gaussians.scales, gaussians.opacities,
                 self.options.quantile, self.records);
}

std::vector<RayResult> RayTracer::trace(const DeviceGaussians& gaussians,
                                        std::span<const Ray> rays,
                                        ColorDirection color_direction) {
  Impl& self = *impl_;
  if (self.tree.size() != gaussians.count) {
    throw UsageError("RayTracer::update() must follow every change of the Gaussians");
  }
  BuildOptions build;
  build.define("PEAK_ORDER", self.options.hit_order == HitOrder::kPeak ? 1 : 0);
  Kernel kernel = self.context.kernel("trace/rays.cl", "trace_rays", build);
  const std::array<float, 4> background{self.options.background[0], self.options.background[1],
                                        self.options.background[2], 0.0f};
  const std::size_t batch = std::max<std::size_t>(
      kGroup, std::min<std::size_t>(self.options.memory_budget / 2 / kRayBytes,
                                    self.context.device().max_allocation / sizeof(Ray)));
  std::vector<RayResult> out(rays.size());
  for (std::size_t begin = 0; begin < rays.size(); begin += batch) {
    const std::size_t count = std::min(batch, rays.size() - begin);
    self.rays.ensure(self.context, count, "rays");
    self.results.ensure(self.context, count, "ray results");
    self.rays.upload(rays.subspan(begin, count));
    kernel.launch(
        Range::linear(count, kGroup), static_cast<std::uint32_t>(count), self.tree.root(),
        static_cast<std::uint32_t>(gaussians.count), self.tree.nodes(), self.tree.leaves(),
        self.records, gaussians.sh, sh_coefficients(gaussians.sh_degree),
        gaussians.active_sh_degree, color_direction == ColorDirection::kFromOrigin ? 1 : 0,
        self.options.min_transmittance, self.options.max_hits, background, self.rays, self.results);
    self.results.download(std::span<RayResult>(out).subspan(begin, count));
  }
  return out;
}

}  // namespace raysplats
