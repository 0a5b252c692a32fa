// SPDX-License-Identifier: Apache-2.0
#include "bench/self_test.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "bench/kept_failure.hpp"
#include "bench/larger.hpp"
#include "light/view_tracer.hpp"
#include "reference/gradients.hpp"
#include "reference/scenes.hpp"
#include "reference/tracer.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGaussians = 200;
constexpr std::uint64_t kSeed = 11;
constexpr int kDegree = 2;
constexpr int kWidth = 48, kHeight = 40;
// Rays with a decision that single precision may take otherwise are left out.
constexpr double kTie = 1e-4;
// As the tests of the kernels have them.
constexpr double kMeanLimit = 1e-4;
constexpr double kMostLimit = 2e-3;
constexpr double kGradientLimit = 2e-3;

struct Expected {
  reference::Render render;
  std::vector<float> image_gradient;
  reference::Gradient gradient;
};

Expected expected_of(const Gaussians& model, const TraceOptions& options, const Camera& camera) {
  Expected out;
  const reference::Parameters parameters(model, ScaleActivation::kExp);
  out.render = reference::render(parameters, options, camera);
  const std::size_t pixels = out.render.pixels();
  CounterRng random(kSeed, 1);
  out.image_gradient.resize(4 * pixels);
  for (std::size_t i = 0; i < out.image_gradient.size(); ++i) {
    const auto value = static_cast<float>(random.normal());
    out.image_gradient[i] = out.render.margin[i % pixels] < kTie ? 0.0f : value;
  }
  const std::vector<double> wide(out.image_gradient.begin(), out.image_gradient.end());
  out.gradient = reference::render_gradient(parameters, options, camera, wide);
  return out;
}

// |a - b| / |b| of two vectors as wholes.
double relative_error(const std::vector<float>& a, const std::vector<double>& b) {
  double difference = 0, norm = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    difference += (a[i] - b[i]) * (a[i] - b[i]);
    norm += b[i] * b[i];
  }
  return std::sqrt(difference / std::max(norm, 1e-300));
}

void check_way(Context& context,
               const TraceOptions& options,
               const std::string& way,
               const Gaussians& model,
               const Camera& camera,
               const Expected& expected,
               std::vector<SelfTestCheck>& out) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  ViewTracer tracer(context, options);
  tracer.forward(gaussians, camera, true);
  const Image image = tracer.download_image();
  double mean = 0, most = 0;
  const std::size_t pixels = expected.render.pixels();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      const double difference = std::abs(static_cast<double>(image.data[4 * i + c]) -
                                         expected.render.image[c * pixels + i]);
      mean += difference / static_cast<double>(4 * pixels);
      if (expected.render.margin[i] >= kTie) most = larger(most, difference);
    }
  }
  out.push_back({way + ": image, mean difference", mean, kMeanLimit});
  out.push_back({way + ": image, largest difference", most, kMostLimit});
  Buffer<float> image_gradient(context, expected.image_gradient.size(), "image gradient");
  image_gradient.upload(expected.image_gradient);
  GaussianGradients gradients;
  tracer.backward(gaussians, image_gradient, gradients);
  const reference::Parameters& right = expected.gradient.parameters;
  const auto check = [&](const char* group, const Buffer<float>& got,
                         const std::vector<double>& wanted) {
    out.push_back(
        {way + ": gradients of " + group, relative_error(got.download(), wanted), kGradientLimit});
  };
  check("means", gradients.means, right.means);
  check("quaternions", gradients.quaternions, right.quaternions);
  check("scales", gradients.scales, right.scales);
  check("opacities", gradients.opacities, right.opacities);
  check("spherical harmonics", gradients.sh, right.sh);
}

}  // namespace

std::vector<SelfTestCheck> run_self_test(Context& context,
                                         TraceOptions options,
                                         bool keep_failures) {
  const Gaussians model = reference::random_scene(kGaussians, kSeed, kDegree);
  const Camera camera = reference::cube_camera(kWidth, kHeight);
  const Expected expected = expected_of(model, options, camera);
  std::vector<SelfTestCheck> out;
  const auto check = [&](Traversal traversal, const std::string& way) {
    options.traversal = traversal;
    const auto all = [&] { check_way(context, options, way, model, camera, expected, out); };
    if (!keep_failures) return all();
    const std::string failure = failure_of(all).reason;
    if (failure.empty()) return;
    out.push_back({way + ": all of it", std::numeric_limits<double>::quiet_NaN(), 0.0, failure});
  };
  check(Traversal::kTiles, "tiles");
  check(Traversal::kBvh, "tree");
  return out;
}

}  // namespace raysplats
