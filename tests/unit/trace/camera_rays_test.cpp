// SPDX-License-Identifier: Apache-2.0
#include "trace/camera_rays.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "scene/camera/camera_model.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/image/pixel_places.hpp"
#include "shared/random.h"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;
using reference::posed;

namespace {

/// Numbers as calibrations of phones, action cameras and 180 and 220 degree lenses give them.
std::vector<Camera> cameras() {
  return {
      posed(CameraModel::kPinhole, 320, 240, 260, 257),
      posed(CameraModel::kOpenCv, 270, 480, 684, 681, {0.0578, -0.0805, 0, -0.00098, 0.00016, 0}),
      posed(CameraModel::kOpenCv, 400, 300, 300, 300, {-0.26, 0.09, -0.013, 0.0011, -0.0007, 0}),
      posed(CameraModel::kOpenCv, 4000, 30, 3100, 3090, {-0.02, 0.011, 0, 0.0002, -0.0004, 0}),
      posed(CameraModel::kOpenCv, 300, 200, 210, 230, {0.31, 0.08, 0, 0, 0, 0}),
      posed(CameraModel::kFisheye, 360, 270, 105, 106, {0.0421, -0.0113, 0.0037, 0, 0, -0.00081}),
      posed(CameraModel::kFisheye, 1752, 40, 791, 791, {0.0417, -0.0168, 0.0184, 0, 0, -0.0067}),
      posed(CameraModel::kFisheye, 300, 300, 80, 80),
      posed(CameraModel::kEquirectangular, 512, 256, 1, 1),
      posed(CameraModel::kOrthographic, 320, 240, 80, 95),
  };
}

std::vector<Ray> make_rays(Context& context, const Camera& camera, const Lens& lens = {}) {
  CameraRays generator(context);
  Buffer<Ray> rays;
  const std::size_t pixels = pixel_count(camera);
  generator.generate(camera, lens, 0, pixels, rays);
  std::vector<Ray> out(pixels);
  rays.download(std::span<Ray>(out));
  return out;
}

glm::dvec3 origin_of(const Ray& ray) { return {ray.origin[0], ray.origin[1], ray.origin[2]}; }
glm::dvec3 direction_of(const Ray& ray) {
  return {ray.direction[0], ray.direction[1], ray.direction[2]};
}

/// Where a point of a ray is seen, in pixels, with the wrap of a panorama taken out.
double pixel_error(const Camera& camera, const Ray& ray, double px, double py) {
  const std::optional<glm::dvec2> seen = project(camera, origin_of(ray) + 3.0 * direction_of(ray));
  if (!seen) return std::numeric_limits<double>::infinity();
  double across = std::abs(seen->x - px);
  if (camera.model == CameraModel::kEquirectangular)
    across = std::min(across, camera.width - across);
  // A pole is seen in all columns.
  const double scale = camera.model == CameraModel::kEquirectangular
                           ? std::sin(std::numbers::pi * py / camera.height)
                           : 1.0;
  return std::hypot(scale * across, seen->y - py);
}

double chi_squared(const std::vector<int>& bins, double expected) {
  double sum = 0;
  for (const int count : bins) sum += (count - expected) * (count - expected) / expected;
  return sum;
}

}  // namespace

TEST_CASE("camera rays equal the double reference [small]") {
  Context context = make_test_context();
  for (const Camera& camera : cameras()) {
    CAPTURE(static_cast<int>(camera.model));
    CAPTURE(camera.fx);
    const std::vector<Ray> rays = make_rays(context, camera);
    double worst_direction = 0, worst_origin = 0, worst_pixel = 0, worst_length = 0;
    std::size_t valid = 0, disagree = 0, zero_starts = 0, infinite_ends = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const auto width = static_cast<std::size_t>(camera.width);
      const std::size_t column = i % width, row = i / width;
      const double px = static_cast<double>(column) + 0.5;
      const double py = static_cast<double>(row) + 0.5;
      const CameraRay expected = camera_ray(camera, px, py);
      const Ray& ray = rays[i];
      zero_starts += ray.t_min == 0.0f ? 1 : 0;
      if (expected.valid != (ray.t_max > 0)) ++disagree;
      if (!expected.valid || !(ray.t_max > 0)) {
        // What an empty ray has for a direction is open, but it must be one.
        worst_length = std::max(worst_length, std::abs(glm::length(direction_of(ray)) - 1));
        continue;
      }
      ++valid;
      infinite_ends += ray.t_max == std::numeric_limits<float>::max() ? 1 : 0;
      worst_direction =
          std::max(worst_direction, glm::length(direction_of(ray) - expected.direction));
      worst_origin = std::max(worst_origin, glm::length(origin_of(ray) - expected.origin));
      worst_length = std::max(worst_length, std::abs(glm::length(direction_of(ray)) - 1));
      worst_pixel = std::max(worst_pixel, pixel_error(camera, ray, px, py));
    }
    CHECK(worst_direction < 5e-6);
    CHECK(worst_origin < 2e-6);
    CHECK(worst_length < 3e-7);
    CHECK(worst_pixel < 0.005);
    CHECK(zero_starts == rays.size());
    CHECK(infinite_ends == valid);
    CHECK(disagree == 0);
    CHECK(valid > rays.size() / 2);
  }
}

TEST_CASE("camera rays: what a lens cannot see is an empty ray and shows the background") {
  Context context = make_test_context();
  Camera camera = posed(CameraModel::kFisheye, 64, 48, 8, 8);
  const std::vector<Ray> rays = make_rays(context, camera);
  const Gaussians model = reference::random_scene(200, 9, 1);
  TraceOptions options;
  options.background = {0.2f, 0.4f, 0.6f};
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  RayTracer tracer(context, options);
  tracer.update(gaussians);
  const std::vector<RayResult> results = tracer.trace(gaussians, rays, ColorDirection::kFromOrigin);
  std::size_t empty = 0, seen = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (rays[i].t_max > 0) {
      seen += results[i].hits > 0 ? 1 : 0;
      continue;
    }
    ++empty;
    CHECK(rays[i].t_max == -1.0f);
    CHECK(results[i].color[0] == 0.2f);
    CHECK(results[i].color[1] == 0.4f);
    CHECK(results[i].color[2] == 0.6f);
    CHECK(results[i].alpha == 0.0f);
    CHECK(results[i].hits == 0);
  }
  CHECK(empty > 500);
  CHECK(seen > 100);
}

TEST_CASE("camera rays: a lens that folds ends where the reference ends") {
  Context context = make_test_context();
  for (const Distortion& d :
       {Distortion{-0.3, 0, 0, 0, 0, 0}, Distortion{-0.3, 0, 0, 0.0008, -0.0012, 0}}) {
    Camera camera = posed(CameraModel::kOpenCv, 320, 320, 160, 160, d);
    const std::vector<Ray> rays = make_rays(context, camera);
    std::size_t disagree = 0, invalid = 0;
    double worst = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const std::size_t column = i % 320, row = i / 320;
      const double px = static_cast<double>(column) + 0.5, py = static_cast<double>(row) + 0.5;
      const CameraRay expected = camera_ray(camera, px, py);
      disagree += expected.valid != (rays[i].t_max > 0) ? 1 : 0;
      invalid += expected.valid ? 0 : 1;
      if (expected.valid && rays[i].t_max > 0)
        worst = std::max(worst, pixel_error(camera, rays[i], px, py));
    }
    CHECK(invalid > 1000);
    CHECK(disagree <= 4);
    CHECK(worst < 0.01);
  }
}

namespace {

// Compilers may round a loop's remainder otherwise than its vectors.
bool nearly_same(const Ray& a, const Ray& b) {
  const auto near = [](float x, float y) {
    return x == y || std::abs(x - y) <= 1e-6f * std::max(1.0f, std::abs(x));
  };
  bool same = near(a.t_min, b.t_min) && near(a.t_max, b.t_max);
  for (std::size_t i = 0; i < 3; ++i)
    same = same && near(a.origin[i], b.origin[i]) && near(a.direction[i], b.direction[i]);
  return same;
}

}  // namespace

TEST_CASE("camera rays do not depend on how pixels are split") {
  Context context = make_test_context();
  const Camera camera = posed(CameraModel::kFisheye, 90, 61, 30, 31);
  const Lens lens{3, 0x123456789abcdefull, 0.1f, 2.0f};
  const std::vector<Ray> whole = make_rays(context, camera, lens);
  CameraRays generator(context);
  Buffer<Ray> part(context, 1000, "rays");
  for (const auto& [first, count] :
       {std::pair<std::size_t, std::size_t>{0, 1}, {1, 999}, {1000, 1000}, {5000, 490}}) {
    generator.generate(camera, lens, first, count, part);
    CHECK(part.size() == 1000);
    std::vector<Ray> found(count);
    part.download(std::span<Ray>(found));
    CHECK(std::equal(found.begin(), found.end(), whole.begin() + static_cast<std::ptrdiff_t>(first),
                     nearly_same));
  }
  CHECK_THROWS_AS(generator.generate(camera, lens, 5000, 491, part), UsageError);
  CHECK(std::memcmp(make_rays(context, camera, lens).data(), whole.data(),
                    whole.size() * sizeof(Ray)) == 0);
}

TEST_CASE("camera rays: a moved camera's go through the places in the pixels [small]") {
  Context context = make_test_context();
  for (const Camera& camera : cameras()) {
    if (camera.model == CameraModel::kEquirectangular) continue;
    CAPTURE(static_cast<int>(camera.model));
    const glm::dvec3 place(0.31, -0.42, 0.1);
    const std::vector<Ray> rays = make_rays(context, moved_in_pixels(camera, place));
    double worst = 0;
    std::size_t seen = 0;
    const auto width = static_cast<std::size_t>(camera.width);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!(rays[i].t_max > 0)) continue;
      ++seen;
      const std::size_t column = i % width, row = i / width;
      worst =
          std::max(worst, pixel_error(camera, rays[i], static_cast<double>(column) + 0.5 + place.x,
                                      static_cast<double>(row) + 0.5 + place.y));
    }
    CHECK(seen > 1000);
    CHECK(worst < 0.005);
  }
}

TEST_CASE("places in a pixel are stratified, centred for seed 0 and uniform over seeds [small]") {
  CHECK(pixel_place(0, 1, 0) == glm::dvec3(0.0));
  CHECK(pixel_place(0, 1, 7) == glm::dvec3(0.0));
  for (const std::uint64_t samples : {2, 3, 4, 7, 12, 16, 64, 1000}) {
    CAPTURE(samples);
    for (const std::uint64_t seed : {std::uint64_t{0}, std::uint64_t{1}, ~std::uint64_t{0}}) {
      std::array<std::vector<bool>, 3> taken;
      taken.fill(std::vector<bool>(samples));
      glm::dvec3 sum(0.0);
      for (std::uint64_t sample = 0; sample < samples; ++sample) {
        const glm::dvec3 place = pixel_place(sample, samples, seed);
        sum += place;
        for (int k = 0; k < 3; ++k) {
          REQUIRE(std::abs(place[k]) <= 0.5);
          taken[static_cast<std::size_t>(k)][static_cast<std::size_t>(
              std::floor((place[k] + 0.5) * static_cast<double>(samples)))] = true;
        }
      }
      for (const auto& parts : taken)
        CHECK(std::find(parts.begin(), parts.end(), false) == parts.end());
      if (seed == 0) CHECK(glm::length(sum) < 1e-9 * static_cast<double>(samples));
    }
  }
  // Strips have a quarter of the places each; within them the deviation is 55 at most.
  std::array<double, 16> bins{};
  for (std::uint64_t seed = 1; seed <= 6400; ++seed) {
    for (std::uint64_t sample = 0; sample < 4; ++sample) {
      const glm::dvec3 place = pixel_place(sample, 4, seed) + 0.5;
      bins[static_cast<std::size_t>(place.x * 4) * 4 + static_cast<std::size_t>(place.y * 4)] += 1;
    }
  }
  for (const double count : bins) CHECK(std::abs(count - 1600) < 220);
}

TEST_CASE("camera rays: those of a lens meet in the point in focus") {
  Context context = make_test_context();
  for (Camera camera : cameras()) {
    CAPTURE(static_cast<int>(camera.model));
    const float aperture = 0.2f;
    const Lens sharp{2, 77, 0.0f, 1.0f};
    const Lens open{2, 77, aperture, 2.5f};
    const std::vector<Ray> through_center = make_rays(context, camera, sharp);
    const std::vector<Ray> rays = make_rays(context, camera, open);
    const bool perspective =
        camera.model == CameraModel::kPinhole || camera.model == CameraModel::kOpenCv;
    const glm::dvec3 axis(camera.rotation[0][2], camera.rotation[1][2], camera.rotation[2][2]);
    double worst = 0, widest = 0, square = 0, off_plane = 0;
    std::size_t moved = 0, backward = 0;
    glm::dvec3 mean(0.0);
    std::size_t count = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (!(rays[i].t_max > 0)) continue;
      const glm::dvec3 o = origin_of(through_center[i]), d = direction_of(through_center[i]);
      if (camera.model == CameraModel::kOrthographic) {
        moved += origin_of(rays[i]) == o && direction_of(rays[i]) == d ? 0 : 1;
        continue;
      }
      ++count;
      const glm::dvec3 focus = o + d * (perspective ? 2.5 / glm::dot(d, axis) : 2.5);
      const glm::dvec3 offset = origin_of(rays[i]) - o;
      const glm::dvec3 gap = glm::cross(focus - origin_of(rays[i]), direction_of(rays[i]));
      worst = std::max(worst, glm::length(gap));
      widest = std::max(widest, glm::length(offset));
      off_plane = std::max(off_plane, std::abs(glm::dot(offset, axis)));
      backward += glm::dot(focus - origin_of(rays[i]), direction_of(rays[i])) > 0 ? 0 : 1;
      mean += offset;
      square += glm::dot(offset, offset);
    }
    CHECK(moved == 0);
    if (count == 0) continue;
    CHECK(off_plane < 1e-6);
    CHECK(backward == 0);
    CHECK(worst < 5e-6);
    CHECK(widest <= 0.2 + 1e-6);
    CHECK(widest > 0.199);
    // Uniform over a disc: the mean square is half of the radius', the mean zero.
    CHECK(square / static_cast<double>(count) == doctest::Approx(0.02).epsilon(0.02));
    CHECK(glm::length(mean) / static_cast<double>(count) < 0.002);
    const auto differs = [&](const Lens& other) {
      const std::vector<Ray> found = make_rays(context, camera, other);
      std::size_t different = 0;
      for (std::size_t i = 0; i < found.size(); ++i)
        different += found[i].origin[0] != rays[i].origin[0] ? 1 : 0;
      return different;
    };
    CHECK(differs(open) == 0);
    CHECK(differs({3, 77, aperture, 2.5f}) > count * 9 / 10);
    CHECK(differs({2, 77 ^ std::uint64_t{1} << 40, aperture, 2.5f}) > count * 9 / 10);
  }
}

TEST_CASE("random numbers: uniform in every dimension, pair and neighbourhood") {
  constexpr int kBins = 64;
  constexpr int kCount = 1 << 17;
  const auto bin = [](float u) { return static_cast<std::size_t>(u * 8); };
  // 63 degrees of freedom: mean 63, deviation 11.2; the bound is five of them.
  constexpr double kBound = 119.0;
  const auto check = [&](auto&& number) {
    std::array<std::vector<int>, 8> bins;
    for (auto& b : bins) b.assign(kBins, 0);
    RsRandom4 before = number(kCount);
    int outside = 0;
    for (int i = 0; i < kCount; ++i) {
      const RsRandom4 u = number(i);
      const float v[4] = {u.x, u.y, u.z, u.w};
      for (std::size_t k = 0; k < 4; ++k) {
        outside += v[k] >= 0.0f && v[k] < 1.0f ? 0 : 1;
        if (outside == 0) ++bins[k][static_cast<std::size_t>(v[k] * kBins)];
      }
      ++bins[4][8 * bin(u.x) + bin(u.y)];
      ++bins[5][8 * bin(u.z) + bin(u.w)];
      ++bins[6][8 * bin(u.x) + bin(before.x)];
      ++bins[7][8 * bin(u.z) + bin(before.w)];
      before = u;
    }
    CHECK(outside == 0);
    for (std::size_t k = 0; k < bins.size(); ++k) {
      CAPTURE(k);
      CHECK(chi_squared(bins[k], static_cast<double>(kCount) / kBins) < kBound);
    }
  };
  check([](int i) { return rs_random4(0, 0, static_cast<rs_uint>(i), 0, 0); });
  check([](int i) { return rs_random4(1, 7, 12345, static_cast<rs_uint>(i), 2); });
  check([](int i) { return rs_random4(99, 0, 54321, 3, static_cast<rs_uint>(i)); });
  check([](int i) { return rs_random4(static_cast<rs_uint>(i), 0, 1000, 1, 1); });
  check([](int i) { return rs_random4(0, static_cast<rs_uint>(i), 1000, 1, 1); });
}
