// SPDX-License-Identifier: Apache-2.0
// Numbers that are not finite, or finite and absurd, in every field of a model, a camera or a ray:
// a picture of finite numbers or an error, on which the well-behaved Gaussians keep their place.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "trace/ray_tracer.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::array<float, 16> kPoison{std::numeric_limits<float>::quiet_NaN(),
                                        kInfinity,
                                        -kInfinity,
                                        std::numeric_limits<float>::denorm_min(),
                                        -std::numeric_limits<float>::denorm_min(),
                                        std::numeric_limits<float>::min(),
                                        1e38f,
                                        -1e38f,
                                        std::numeric_limits<float>::max(),
                                        1e20f,
                                        -1e20f,
                                        1e3f,
                                        -1e3f,
                                        1e-20f,
                                        0.0f,
                                        -0.0f};

/// A parameter array of a model and how many numbers of it one Gaussian has.
struct Field {
  const char* name;
  std::vector<float> Gaussians::*values;
  std::size_t width;
};

std::vector<Field> fields(const Gaussians& model) {
  return {{"mean", &Gaussians::means, 3},
          {"quaternion", &Gaussians::quaternions, 4},
          {"log scale", &Gaussians::log_scales, 3},
          {"opacity", &Gaussians::opacities, 1},
          {"sh", &Gaussians::sh, 3 * static_cast<std::size_t>(sh_coefficients(model.sh_degree))}};
}

/// Calls visit(model, what) with each poison value in some numbers of Gaussian 1: one at a time,
/// at most the first four of a field, unless `whole_only`, and all numbers of a field.
template <class Visit>
void for_each_poisoned(const Gaussians& model, bool whole_only, Visit visit) {
  for (const Field& field : fields(model)) {
    const std::size_t alone = whole_only ? 0 : std::min<std::size_t>(field.width, 4);
    for (const float value : kPoison) {
      for (std::size_t i = 0; i <= alone; ++i) {
        Gaussians poisoned = model;
        std::vector<float>& values = poisoned.*field.values;
        const std::size_t begin = i < alone ? i : 0;
        const std::size_t end = i < alone ? i + 1 : field.width;
        for (std::size_t k = begin; k < end; ++k) values[field.width + k] = value;
        visit(poisoned, fmt::format("{} {}..{} = {}", field.name, begin, end, value));
      }
    }
  }
}

bool all_finite(std::span<const float> values) {
  return std::all_of(values.begin(), values.end(), [](float v) { return std::isfinite(v); });
}

/// Colours of at least zero, alpha between 0 and 1 up to rounding.
bool is_clean(const Image& image) {
  if (!all_finite(image.data)) return false;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float alpha = image.data[4 * i + 3];
    if (!(alpha >= -1e-6f && alpha <= 1.000001f)) return false;
  }
  return true;
}

bool is_clean(const RayResult& result) {
  return all_finite(result.color) && result.alpha >= -1e-6f && result.alpha <= 1.000001f &&
         std::isfinite(result.expected_depth) && std::isfinite(result.median_depth);
}

/// Five Gaussians in view of cube_camera(), none around it.
Gaussians small_scene() {
  Gaussians model = reference::random_scene(5, 3, 1);
  for (std::size_t i = 0; i < model.log_scales.size(); ++i) {
    model.log_scales[i] = -1.2f - 0.3f * static_cast<float>(i % 3);
  }
  for (float& value : model.opacities) value = 1.0f;
  return model;
}

float mean_alpha(const Image& image) {
  float sum = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) sum += image.data[4 * i + 3];
  return sum / static_cast<float>(image.pixels());
}

}  // namespace

TEST_CASE("poison: any number in a model makes a clean picture from camera rays") {
  Context context = make_test_context();
  const Gaussians model = small_scene();
  const Camera camera = reference::cube_camera(9, 7);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    TraceOptions options;
    options.hit_order = order;
    options.depth = true;
    CameraTracer tracer(context, options);
    for_each_poisoned(model, order == HitOrder::kPeak,
                      [&](const Gaussians& poisoned, const std::string& what) {
                        CAPTURE(what);
                        const DeviceGaussians gaussians =
                            DeviceGaussians::upload(context, poisoned, ScaleActivation::kExp);
                        tracer.update(gaussians);
                        tracer.forward(gaussians, camera);
                        CHECK(is_clean(tracer.download_image()));
                        CHECK(all_finite(tracer.download_depth().data));
                      });
  }
}

TEST_CASE("poison: a Gaussian that is not finite is left out") {
  Context context = make_test_context();
  const Gaussians model = small_scene();
  Gaussians without;
  without.sh_degree = model.sh_degree;
  without.resize(model.size() - 1);
  for (const Field& field : fields(model)) {
    const std::vector<float>& from = model.*field.values;
    std::vector<float>& to = without.*field.values;
    const auto width = static_cast<std::ptrdiff_t>(field.width);
    std::copy(from.begin(), from.begin() + width, to.begin());
    std::copy(from.begin() + 2 * width, from.end(), to.begin() + width);
  }
  const Camera camera = reference::cube_camera(9, 7);
  const Image expected = trace_image(context, without, {}, camera);
  CHECK(mean_alpha(expected) > 0.1f);
  CHECK(mean_alpha(trace_image(context, model, {}, camera)) > mean_alpha(expected) + 0.01f);
  for (const float value : {std::numeric_limits<float>::quiet_NaN(), kInfinity}) {
    for (const Field& field : {fields(model)[0], fields(model)[1], fields(model)[2]}) {
      CAPTURE(field.name);
      Gaussians poisoned = model;
      (poisoned.*field.values)[field.width] = value;
      const Image image = trace_image(context, poisoned, {}, camera);
      for (std::size_t i = 0; i < image.data.size(); ++i) {
        CHECK(image.data[i] == doctest::Approx(expected.data[i]).epsilon(1e-5));
      }
    }
  }
}

TEST_CASE("poison: any number in a model makes clean results of arbitrary rays") {
  Context context = make_test_context();
  const Gaussians model = small_scene();
  std::vector<Ray> rays;
  for (int i = 0; i < 12; ++i) {
    const auto shift = static_cast<float>(i - 6) * 0.1f;
    rays.push_back({{shift, 0.0f, -4.0f}, 0.0f, {0.0f, shift, 1.0f}, 1e30f});
    rays.push_back({{shift, shift, 0.0f}, 0.0f, {1.0f, 0.5f, -shift}, 1e30f});
  }
  RayTracer tracer(context, {});
  for_each_poisoned(model, true, [&](const Gaussians& poisoned, const std::string& what) {
    CAPTURE(what);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, poisoned, ScaleActivation::kExp);
    tracer.update(gaussians);
    for (const RayResult& result : tracer.trace(gaussians, rays)) CHECK(is_clean(result));
  });
}

TEST_CASE("poison: any number in a ray makes a clean result and leaves the others alone") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, small_scene(), ScaleActivation::kExp);
  RayTracer tracer(context, {});
  tracer.update(gaussians);
  const std::vector<float> means = small_scene().means;
  const Ray sound{{0.0f, 0.0f, -4.0f}, 0.0f, {means[0], means[1], means[2] + 4.0f}, 1e30f};
  std::vector<Ray> rays{sound};
  for (const float value : kPoison) {
    for (int i = 0; i < 3; ++i) {
      rays.push_back(sound);
      rays.back().origin[i] = value;
      rays.push_back(sound);
      rays.back().direction[i] = value;
    }
    rays.push_back(sound);
    rays.back().t_min = value;
    rays.push_back(sound);
    rays.back().t_max = value;
    rays.push_back({{value, value, value}, value, {value, value, value}, value});
  }
  rays.push_back(sound);
  const std::vector<RayResult> results = tracer.trace(gaussians, rays);
  for (std::size_t i = 0; i < results.size(); ++i) {
    CAPTURE(i);
    CHECK(is_clean(results[i]));
  }
  CHECK(results.front().alpha > 0.0f);
  CHECK(results.back().alpha == results.front().alpha);
  CHECK(results.back().color[1] == results.front().color[1]);
}

TEST_CASE("poison: any number in a camera makes a clean picture or an error") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, small_scene(), ScaleActivation::kExp);
  CameraTracer tracer(context, {});
  tracer.update(gaussians);
  const Camera sound = reference::cube_camera(9, 7);
  std::vector<double Camera::*> numbers{&Camera::fx, &Camera::fy, &Camera::cx, &Camera::cy};
  std::vector<double> poison(kPoison.begin(), kPoison.end());
  poison.insert(poison.end(), {1e300, -1e300, 1e-300, 5e-324});
  const auto trace = [&](const Camera& camera) {
    try {
      tracer.forward(gaussians, camera);
    } catch (const Error&) {
      return true;
    }
    return is_clean(tracer.download_image());
  };
  for (const double value : poison) {
    CAPTURE(value);
    for (double Camera::*number : numbers) {
      Camera camera = sound;
      camera.*number = value;
      CHECK(trace(camera));
      if (!std::isfinite(value)) CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
    }
    for (int i = 0; i < 3; ++i) {
      Camera camera = sound;
      camera.translation[i] = value;
      CHECK(trace(camera));
      if (!std::isfinite(value)) CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
      for (int j = 0; j < 3; ++j) {
        camera = sound;
        camera.rotation[i][j] = value;
        CHECK(trace(camera));
        if (!std::isfinite(value)) CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
      }
    }
  }
  for (const CameraModel lens : {CameraModel::kOpenCv, CameraModel::kFisheye}) {
    for (double Distortion::*number : {&Distortion::k1, &Distortion::k2, &Distortion::k3,
                                       &Distortion::k4, &Distortion::p1, &Distortion::p2}) {
      for (const float value : kPoison) {
        if (std::isfinite(value)) continue;
        CAPTURE(value);
        Camera camera = sound;
        camera.model = lens;
        camera.distortion.*number = static_cast<double>(value);
        CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
      }
    }
  }
  for (const int side : {std::numeric_limits<int>::min(), -1, 0, std::numeric_limits<int>::max()}) {
    CAPTURE(side);
    Camera camera = sound;
    camera.width = side;
    CHECK_THROWS_AS(tracer.forward(gaussians, camera), Error);
    camera = sound;
    camera.height = side;
    CHECK_THROWS_AS(tracer.forward(gaussians, camera), Error);
  }
  CHECK(trace(sound));
  CHECK(mean_alpha(tracer.download_image()) > 0.1f);
}
