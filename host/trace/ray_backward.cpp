// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_backward.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/vec3.hpp>
#include <numbers>
#include <utility>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "trace/gaussian_kernel.hpp"
#include "trace/launch_budget.hpp"
#include "trace/memory_shares.hpp"

namespace raysplats {
namespace {

constexpr const char* kGradients = "trace/ray_gradients.cl";
constexpr std::size_t kGroup = 64;
// Rays that a work-item takes one after the other on CPUs.
constexpr std::size_t kCpuChunk = 64;

}  // namespace

RayScreen RayScreen::of(const Camera& camera) {
  RayScreen out;
  const glm::dvec3 center = camera.center();
  const bool flat = camera.model == CameraModel::kPinhole || camera.model == CameraModel::kOpenCv;
  const bool around = camera.model == CameraModel::kEquirectangular;
  const double x = around ? std::numbers::pi : camera.width / (2.0 * camera.fx);
  const double y = camera.height / (2.0 * camera.fy);
  if (flat) out.distance = Distance::kDepth;
  if (camera.model == CameraModel::kOrthographic) out.distance = Distance::kNone;
  for (std::size_t k = 0; k < 3; ++k) {
    const int column = static_cast<int>(k);
    out.center[k] = center[column];
    out.axis[k] = camera.rotation[column][2];
    if (!flat) {
      out.rows[k][k] = x;
      continue;
    }
    out.rows[0][k] = x * camera.rotation[column][0];
    out.rows[1][k] = y * camera.rotation[column][1];
    out.rows[2][k] = 0.0;
  }
  return out;
}

RayBackward::RayBackward(Context& context, const RayTracer& tracer)
    : context_(&context),
      tracer_(&tracer),
      order_(context),
      no_ray_gradients_(context, 1, "no gradients of rays"),
      sums_(context, "ray gradient sums"),
      budget_(tracer.options().launch_budget_ms, context.device().type) {}

// RS_RAY_SUMS / 16 of ray_sums.h.
std::size_t RayBackward::sum_lines(int degree) {
  if (degree == 0) return 1;
  return (16 + 3 * static_cast<std::size_t>(sh_coefficients(degree)) + 15) / 16;
}

GradientSumChoice RayBackward::sum_choice(const TraceOptions& options,
                                          const DeviceInfo& device,
                                          std::size_t gaussians,
                                          int degree) {
  return GradientSumChoice::of(options, device, gaussians * sum_lines(degree),
                               MemoryShares(options, device).ray_gradients(), 1);
}

void RayBackward::begin(const DeviceGaussians& gaussians,
                        const RayScreen& screen,
                        std::size_t rays) {
  tracer_->require_current(gaussians);
  if (has_cones(tracer_->options()))
    throw UsageError("Gradients of cones are not known: trace without a view_footprint");
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t j = 0; j < 3; ++j)
      shares_.screen[3 * k + j] = static_cast<float>(screen.rows[k][j]);
    shares_.screen[9 + k] = static_cast<float>(screen.center[k]);
    shares_.screen[13 + k] = static_cast<float>(screen.axis[k]);
  }
  shares_.screen[12] = static_cast<float>(screen.distance);
  shares_.gaussians = u32(gaussians.count);
  shares_.limit = GradientSums::limit(rays);
  degree_ = gaussians.active_sh_degree;
  count_ = gaussians.count;
  revision_ = gaussians.revision;
  rays_ = rays;
  taken_ = 0;
  begun_ = false;
  sums_.prepare(sum_choice(tracer_->options(), context_->device(), count_, degree_),
                count_ * sum_lines(degree_));
  records_.ensure(*context_, 16 * gaussians.count, "ray gradient records");
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0);
  GaussianKernel kernel(*context_, kGradients, "ray_gradient_records", build);
  kernel.launch(gaussians.count, gaussians.means, gaussians.quaternions, gaussians.scales,
                records_);
  begun_ = true;
}

void RayBackward::add(const DeviceGaussians& gaussians,
                      const Buffer<Ray>& rays,
                      std::size_t count,
                      const Buffer<RayResult>& results,
                      const Buffer<ResultGradient>& gradients,
                      ColorDirection color_direction,
                      Buffer<PaddedRayGradient>* ray_gradients) {
  if (!begun_ || count_ != gaussians.count || revision_ != gaussians.revision ||
      degree_ != gaussians.active_sh_degree) {
    throw UsageError("RayBackward::begin() must come before add(), for the same Gaussians");
  }
  if (rays.size() < count || results.size() < count || gradients.size() < count) {
    throw UsageError(
        fmt::format("Gradients of {} rays cannot be taken from {} rays, {} results and {} "
                    "gradients: pass as many of each",
                    count, rays.size(), results.size(), gradients.size()));
  }
  if (count > rays_ - taken_) {
    throw UsageError(
        fmt::format("RayBackward::begin() was told of {} rays and got {} already: tell it of all, "
                    "{} more cannot be taken",
                    rays_, taken_, count));
  }
  taken_ += count;
  if (ray_gradients != nullptr) {
    ray_gradients->ensure(*context_, count, "gradients of rays");
    ray_gradients->clear();
  }
  if (count == 0 || gaussians.count == 0) return;
  const TraceOptions& options = tracer_->options();
  const Lbvh& tree = tracer_->tree().tree();
  const bool shares = shares_items(context_->device(), tree.form());
  const bool ordered = order_.compute(tree, rays, count);
  BuildOptions build = ray_walk_build(tree.form(), options, tracer_->near(), degree_);
  sums_.define(build.define("SH_DEGREE", degree_)
                   .define("WITH_RAY_GRADIENT", ray_gradients != nullptr ? 1 : 0)
                   .define("RAISE_CLAMPED", options.raise_clamped ? 1 : 0)
                   .define("LEAST_WEIGHT", options.least_weight));
  const std::size_t chunk = shares ? kCpuChunk : 1;
  // Rays that all work-items, or a group of them, take in one turn: bands of whole rows leave every
  // ray with the copy that it would go to without.
  const std::size_t group = shares ? 1 : kGroup;
  const std::size_t row = chunk * (sums_.is_private() ? sums_.copies() : group);
  const RsRayWalk walk = ray_walk(options, tracer_->near(), gaussians,
                                  color_direction == ColorDirection::kFromOrigin ? 1 : 0);
  Kernel kernel = context_->kernel("trace/ray_backward.cl", "ray_backward", build);
  in_bands(*context_, budget_, u32((count + row - 1) / row), [&](std::size_t at, std::size_t rows) {
    const std::size_t first = at * row;
    const std::size_t last = std::min(count, first + rows * row);
    const std::size_t items =
        sums_.is_private() ? sums_.copies() : (last - first + chunk - 1) / chunk;
    kernel.launch(Range::linear(items, group), u32(first), u32(last), u32(chunk), u32(items),
                  tracer_->tree().arguments(), gaussians.sh, walk, order_.arguments(rays, ordered),
                  results, gradients, records_, shares_, sums_.target(),
                  ray_gradients != nullptr ? *ray_gradients : no_ray_gradients_);
  });
}

void RayBackward::set_watch(std::function<void(double)> watch) {
  budget_.set_watch(std::move(watch));
}

void RayBackward::finish(const DeviceGaussians& gaussians, GaussianGradients& gradients) {
  if (!begun_ || count_ != gaussians.count || revision_ != gaussians.revision) {
    throw UsageError("RayBackward::begin() must come before finish(), for the same Gaussians");
  }
  const std::size_t n = gaussians.count;
  gradients.ensure(*context_, gaussians);
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0)
      .define("SH_DEGREE", degree_)
      .define("SH_COEFFICIENTS", sh_coefficients(gaussians.sh_degree));
  sums_.round();
  GaussianKernel kernel(*context_, kGradients, "finish_ray_gradients", build);
  kernel.launch(n, u32(sums_.copies()), shares_, sums_.lines(), records_, gaussians.quaternions,
                gaussians.scales, gaussians.opacities, gradients.arguments());
  sums_.settle();
  begun_ = false;
}

}  // namespace raysplats
