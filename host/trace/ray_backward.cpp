// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_backward.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/vec3.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "trace/gaussian_kernel.hpp"

namespace raysplats {
namespace {

constexpr const char* kGradients = "trace/ray_gradients.cl";
constexpr std::size_t kGroup = 64;
// Rays that a work-item takes one after the other on CPUs.
constexpr std::size_t kCpuChunk = 64;

std::uint32_t u32(std::size_t value) { return static_cast<std::uint32_t>(value); }

// RS_RAY_SUMS of ray_sums.h.
std::size_t sums_per_gaussian(int degree) {
  if (degree == 0) return 16;
  return (16 + 3 * static_cast<std::size_t>(sh_coefficients(degree)) + 15) / 16 * 16;
}

}  // namespace

RayScreen RayScreen::of(const Camera& camera) {
  RayScreen out;
  const glm::dvec3 center = camera.center();
  const bool flat = camera.model == CameraModel::kPinhole || camera.model == CameraModel::kOpenCv;
  const bool around = camera.model == CameraModel::kEquirectangular;
  const double x = around ? 1.0 / std::numbers::pi : camera.width / (2.0 * camera.fx);
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
    : context_(&context), tracer_(&tracer), order_(context) {}

// As CameraTracer: CPUs add to private copies, without atomics and the same sum every time; GPUs
// have too many work-items for that. Returns copies and whether they are private.
std::array<std::size_t, 2> RayBackward::choose_copies(std::size_t count, std::size_t sums) const {
  const DeviceInfo& device = context_->device();
  const std::size_t units = device.compute_units;
  const std::size_t bytes = std::max<std::size_t>(count, 1) * sums * sizeof(float);
  const std::size_t room =
      std::min<std::size_t>(tracer_->options().memory_budget / 2, device.max_allocation) / bytes;
  const bool private_copies = device.type == DeviceType::kCpu && room >= units;
  return {private_copies ? units : 1, private_copies ? std::size_t{1} : 0};
}

void RayBackward::begin(const DeviceGaussians& gaussians, const RayScreen& screen) {
  if (tracer_->tree().tree().size() != gaussians.count) {
    throw UsageError("RayTracer::update() must follow every change of the Gaussians");
  }
  for (std::size_t k = 0; k < 3; ++k) {
    for (std::size_t j = 0; j < 3; ++j) screen_[3 * k + j] = static_cast<float>(screen.rows[k][j]);
    screen_[9 + k] = static_cast<float>(screen.center[k]);
    screen_[13 + k] = static_cast<float>(screen.axis[k]);
  }
  screen_[12] = static_cast<float>(screen.distance);
  degree_ = gaussians.active_sh_degree;
  const std::size_t sums = sums_per_gaussian(degree_);
  const auto [copies, private_copies] = choose_copies(gaussians.count, sums);
  private_copies_ = private_copies != 0;
  const std::array<std::size_t, 3> shape{gaussians.count, sums, copies};
  const bool tidy = shape == shape_ && !begun_;
  shape_ = shape;
  sums_.ensure(*context_, gaussians.count * sums * copies, "ray gradient sums");
  sums_.clear(gaussians.count * sums * (tidy ? 1 : copies));
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
                      const Buffer<Gradient>& gradients,
                      ColorDirection color_direction) {
  if (!begun_ || shape_[0] != gaussians.count || degree_ != gaussians.active_sh_degree) {
    throw UsageError("RayBackward::begin() must come before add(), for the same Gaussians");
  }
  if (color_direction == ColorDirection::kPerRay) {
    throw UsageError("Gradients of rays with flags of their own are not taken: pass one direction");
  }
  if (rays.size() < count || results.size() < count || gradients.size() < count) {
    throw UsageError(
        fmt::format("Gradients of {} rays cannot be taken from {} rays, {} results and {} "
                    "gradients: pass as many of each",
                    count, rays.size(), results.size(), gradients.size()));
  }
  if (count == 0 || gaussians.count == 0) return;
  const DeviceInfo& device = context_->device();
  const TraceOptions& options = tracer_->options();
  const WideTree& tree = tracer_->tree().tree();
  const bool cpu = device.type == DeviceType::kCpu;
  const bool ordered = order_.compute(tree, rays, count);
  BuildOptions build = ray_walk_build(device, options, tree.lanes());
  build.define("SH_DEGREE", degree_).define("PRIVATE_COPIES", private_copies_ ? 1 : 0);
  const std::size_t chunk = cpu ? kCpuChunk : 1;
  const std::size_t items = private_copies_ ? shape_[2] : (count + chunk - 1) / chunk;
  const std::array<float, 4> background{options.background[0], options.background[1],
                                        options.background[2], 0.0f};
  context_->kernel("trace/ray_backward.cl", "ray_backward", build)
      .launch(Range::linear(items, cpu ? 1 : kGroup), u32(count), u32(chunk), u32(items),
              u32(gaussians.count), tree.levels(), tree.level_begin(), tree.nodes(),
              tracer_->tree().blocks(), gaussians.sh, sh_coefficients(gaussians.sh_degree),
              color_direction == ColorDirection::kFromOrigin ? 1 : 0, options.quantile,
              options.min_transmittance, options.max_hits, background, screen_, rays,
              ordered ? 1 : 0, order_.indices(), results, gradients, records_, sums_);
}

void RayBackward::finish(const DeviceGaussians& gaussians, GaussianGradients& gradients) {
  if (!begun_ || shape_[0] != gaussians.count) {
    throw UsageError("RayBackward::begin() must come before finish(), for the same Gaussians");
  }
  const std::size_t n = gaussians.count;
  gradients.means.ensure(*context_, 3 * n, "mean gradients");
  gradients.quaternions.ensure(*context_, 4 * n, "quaternion gradients");
  gradients.scales.ensure(*context_, 3 * n, "scale gradients");
  gradients.opacities.ensure(*context_, n, "opacity gradients");
  gradients.sh.ensure(*context_, gaussians.sh.size(), "SH gradients");
  gradients.screen.ensure(*context_, 3 * n, "screen gradients");
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0)
      .define("SH_DEGREE", degree_)
      .define("SH_COEFFICIENTS", sh_coefficients(gaussians.sh_degree));
  GaussianKernel kernel(*context_, kGradients, "finish_ray_gradients", build);
  kernel.launch(n, u32(n), u32(shape_[2]), sums_, records_, gaussians.quaternions, gaussians.scales,
                gaussians.opacities, screen_, gradients.means, gradients.quaternions,
                gradients.scales, gradients.opacities, gradients.sh, gradients.screen);
  begun_ = false;
}

}  // namespace raysplats
