// SPDX-License-Identifier: Apache-2.0
#include "bench/scene_state.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "scene/morton_order.hpp"
#include "scene/statistics.hpp"
#include "synth/bench_scenes.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::uint64_t kPictureStream = 1;
constexpr std::uint64_t kGradientStream = 2;
// Every so many Gaussians are densified.
constexpr std::size_t kDensifyEvery = 10;
// Share of the means beyond either end of what counts as the middle of a model.
constexpr double kOutliers = 0.05;

std::vector<float> random_floats(std::size_t count,
                                 double scale,
                                 std::uint64_t seed,
                                 std::uint64_t stream) {
  CounterRng random(seed, stream);
  std::vector<float> out(count);
  for (float& value : out) value = static_cast<float>(scale * (2.0 * random.uniform() - 1.0));
  return out;
}

void upload(Context& context,
            Buffer<float>& buffer,
            const std::vector<float>& values,
            const char* label) {
  buffer.ensure(context, values.size(), label);
  buffer.upload(values);
}

}  // namespace

DeviceGaussians& SceneBench::Impl::gaussians() {
  if (!device_gaussians) {
    device_gaussians =
        DeviceGaussians::upload(context, in_morton_order(model.gaussians), ScaleActivation::kExp);
  }
  return *device_gaussians;
}

const Buffer<RsAabb>& SceneBench::Impl::boxes() {
  if (!bounds_kernel) {
    bounds_kernel.emplace(context, false, options.trace.adaptive_radius);
    // In the order of the model: a builder must not be given its work done.
    const DeviceGaussians g =
        DeviceGaussians::upload(context, model.gaussians, ScaleActivation::kExp);
    bounds_kernel->compute(g.means, g.quaternions, g.scales, g.opacities, g.count,
                           options.trace.quantile, box_buffer);
  }
  return box_buffer;
}

CameraTracer& SceneBench::Impl::tracer() {
  if (!camera_tracer) camera_tracer = std::make_unique<CameraTracer>(context, options.trace);
  if (traced_revision != gaussians().revision) camera_tracer->update(gaussians());
  traced_revision = gaussians().revision;
  return *camera_tracer;
}

RayTracer& SceneBench::Impl::rays_tracer() {
  if (!ray_tracer) ray_tracer = std::make_unique<RayTracer>(context, of_bare_rays(options.trace));
  return *ray_tracer;
}

ViewTracer& SceneBench::Impl::view_tracer() {
  if (!tree_view_tracer) {
    TraceOptions trace = options.trace;
    trace.traversal = Traversal::kBvh;
    tree_view_tracer = std::make_unique<ViewTracer>(context, trace);
    tree_view_tracer->forward(gaussians(), model.camera);
  }
  return *tree_view_tracer;
}

void SceneBench::Impl::forward_with_hits() {
  tracer().forward(gaussians(), model.camera, true);
  kept_statistics = view_statistics = tracer().statistics();
}

void SceneBench::Impl::make_loss() {
  if (image_loss) return;
  image_loss = std::make_unique<ImageLoss>(context, PixelLoss::kL1, ImageLoss::Weights{0.2f});
  const auto size = static_cast<std::size_t>(pixels());
  std::vector<float> image = random_floats(4 * size, 0.5, options.seed, kPictureStream);
  for (float& value : image) value += 0.5f;
  upload(context, picture, image, "picture");
  CounterRng random(options.seed, kPictureStream + 100);
  std::vector<std::uint32_t> packed(size);
  for (std::uint32_t& pixel : packed) {
    pixel = static_cast<std::uint32_t>(random.bits()) | 0xff000000u;
  }
  photo.ensure(context, size, "photo");
  photo.upload(packed);
}

void SceneBench::Impl::make_gradients() {
  if (!adam) adam.emplace(context, AdamOptions{});
  if (gradients.means.size() > 0) return;
  gradients.ensure(context, gaussians());
  for_each_group(
      [this](ParameterGroup, Buffer<float>& buffer) {
        buffer.upload(random_floats(buffer.size(), 1e-3, options.seed, kGradientStream));
      },
      gradients);
  constexpr std::size_t kNumbers = GaussianGradients::kScreenNumbers;
  std::vector<float> screen(kNumbers * count());
  for (std::size_t i = 0; i < screen.size(); i += kNumbers) {
    screen[i] = screen[i + 1] = 1e-4f;
    screen[i + 2] = 1.0f;
  }
  upload(context, gradients.screen, screen, "screen gradients");
}

void SceneBench::Impl::make_density() {
  if (density) return;
  TrainOptions rules;
  rules.strategy = DensityStrategy::kAdc;
  rules.densify_grad_threshold = 0.5;
  rules.densify_size = 0.01;
  rules.prune_scale = 0.0;
  rules.max_gaussians = static_cast<std::int64_t>(2 * count());
  density.emplace(context, rules, 1.0, 1);
  density_signal.assign(kDensityStatistics * count(), 0.0f);
  for (std::size_t i = 0; i < count(); ++i) {
    density_signal[kDensityStatistics * i] = i % kDensifyEvery == 0 ? 1.0f : 0.0f;
    density_signal[kDensityStatistics * i + 1] = 1.0f;
  }
}

// Outliers of trained models lie far away.
SceneBench::Impl::Middle SceneBench::Impl::middle() const {
  Middle out;
  if (model.unit_cube) return out;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (std::size_t i = 0; i < count(); ++i) {
      values.push_back(static_cast<double>(model.gaussians.means[3 * i + axis]));
    }
    const std::array<double, 2> ends{kOutliers, 1.0 - kOutliers};
    const std::vector<double> range = quantiles(std::move(values), ends);
    out.center[axis] = 0.5 * (range[0] + range[1]);
    out.half[axis] = std::max(0.5 * (range[1] - range[0]), 1e-6);
  }
  return out;
}

// The rays of the generated scenes, stretched to the middle of other models.
void SceneBench::Impl::make_rays() {
  if (!ray_list.empty()) return;
  const auto [center, half] = middle();
  const std::size_t rays = std::min(options.rays, static_cast<std::size_t>(pixels()));
  for (const Ray& unit : bench_rays(rays, options.seed)) {
    Ray ray{};
    ray.t_min = unit.t_min;
    double length2 = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ray.origin[axis] = static_cast<float>(center[axis] + half[axis] * unit.origin[axis]);
      ray.direction[axis] = static_cast<float>(half[axis] * unit.direction[axis]);
      length2 += static_cast<double>(ray.direction[axis]) * ray.direction[axis];
    }
    const auto length = static_cast<float>(std::sqrt(length2));
    for (float& component : ray.direction) component /= length;
    ray.t_max = unit.t_max * length;
    ray_list.push_back(ray);
  }
}

DeviceGaussians SceneBench::Impl::copy_of_gaussians() {
  const DeviceGaussians& from = gaussians();
  DeviceGaussians out;
  out.count = from.count;
  out.sh_degree = from.sh_degree;
  out.active_sh_degree = from.active_sh_degree;
  out.activation = from.activation;
  out.changed(context);
  out.ensure(context, from.count, from.sh_degree, "copied parameters");
  for_each_group([](ParameterGroup, const Buffer<float>& source,
                    Buffer<float>& target) { target.copy_from(source, source.size()); },
                 from, out);
  return out;
}

}  // namespace raysplats
