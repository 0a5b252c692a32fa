// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/gaussian_transform.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <string>

#include "raysplats/error.hpp"
#include "reference/gaussian.hpp"
#include "reference/scenes.hpp"
#include "reference/tracer.hpp"

using namespace raysplats;

namespace {

constexpr double kAngle = 0.9;

glm::dmat4 rotation() {
  return glm::rotate(glm::dmat4(1.0), kAngle, glm::normalize(glm::dvec3(1, -2, 0.5)));
}

glm::dmat4 similarity() {
  return glm::translate(glm::dmat4(1.0), glm::dvec3(0.7, -1.2, 3)) * rotation() *
         glm::scale(glm::dmat4(1.0), glm::dvec3(2.5));
}

glm::dmat4 stretch() {
  return glm::translate(glm::dmat4(1.0), glm::dvec3(-0.3, 0.4, 0.2)) * rotation() *
         glm::scale(glm::dmat4(1.0), glm::dvec3(0.5, 2.0, 1.1)) *
         glm::rotate(glm::dmat4(1.0), 0.4, glm::dvec3(0, 0, 1));
}

glm::dmat4 reflection() { return similarity() * glm::scale(glm::dmat4(1.0), glm::dvec3(1, -1, 1)); }

glm::dvec3 direction(int k) {
  return glm::normalize(glm::dvec3(std::sin(1.7 * k), std::cos(2.3 * k), std::sin(0.6 * k + 1)));
}

/// S R^T C ... as R S S R^T: the covariance of Gaussian i.
glm::dmat3 covariance(const reference::Parameters& p, std::size_t i) {
  const glm::dmat3 inverse = glm::inverse(reference::whitening_matrix(p, i));
  return inverse * glm::transpose(inverse);
}

double largest(const glm::dmat3& m) {
  double out = 0.0;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) out = std::max(out, std::abs(m[k][j]));
  }
  return out;
}

/// A camera whose rays the map takes to those of the original one, for pixels in the same place.
Camera moved(const Camera& camera, const glm::dmat4& map) {
  const glm::dmat3 q = orthogonal_factor(glm::dmat3(map));
  Camera out = camera;
  const glm::dvec3 eye(map * glm::dvec4(camera.center(), 1.0));
  out.rotation = camera.rotation * glm::transpose(q);
  out.translation = -(out.rotation * eye);
  return out;
}

}  // namespace

TEST_CASE("a moved Gaussian has the moved mean and covariance") {
  const Gaussians model = reference::random_scene(200, 3, 0);
  const reference::Parameters before(model);
  for (const glm::dmat4& map : {rotation(), similarity(), stretch(), reflection()}) {
    const reference::Parameters after(transformed(model, map));
    const glm::dmat3 linear(map);
    for (std::size_t i = 0; i < model.size(); ++i) {
      const glm::dvec3 mean(map * glm::dvec4(before.mean(i), 1.0));
      CHECK(glm::length(after.mean(i) - mean) < 1e-6);
      const glm::dmat3 expected = linear * covariance(before, i) * glm::transpose(linear);
      CHECK(largest(covariance(after, i) - expected) < 2e-6 * largest(expected));
    }
  }
}

TEST_CASE("thin Gaussians keep their thinness under a stretch") {
  Gaussians model;
  model.resize(1);
  model.log_scales = {0.0f, -20.0f, -40.0f};
  model.quaternions = {0.4f, -0.2f, 0.7f, 0.1f};
  const reference::Parameters before(model);
  const glm::dmat3 linear(stretch());
  const Gaussians out = transformed(model, stretch());
  // The volume is exact whatever the axes.
  const double volume = out.log_scales[0] + out.log_scales[1] + out.log_scales[2];
  CHECK(volume == doctest::Approx(-60.0 + std::log(std::abs(glm::determinant(linear)))));
  // The plane of the disc maps by the inverse transpose.
  const glm::dmat3 axes = glm::transpose(reference::whitening_matrix(before, 0));
  const glm::dvec3 normal = glm::normalize(glm::transpose(glm::inverse(linear)) * axes[2]);
  const glm::dmat3 found =
      glm::transpose(reference::whitening_matrix(reference::Parameters(out), 0));
  double best = 0.0;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(out.log_scales[static_cast<std::size_t>(k)] + 40.0f) < 3.0f) {
      best = std::abs(glm::dot(glm::normalize(found[k]), normal));
    }
  }
  CHECK(best > 1.0 - 1e-6);
}

TEST_CASE("colours turn with the model, up to degree 4, reflections too") {
  for (int degree = 0; degree <= 4; ++degree) {
    const Gaussians model = reference::random_scene(20, 11, degree);
    const reference::Parameters before(model);
    for (const glm::dmat4& map : {rotation(), similarity(), stretch(), reflection()}) {
      const glm::dmat3 q = orthogonal_factor(glm::dmat3(map));
      const reference::Parameters after(transformed(model, map));
      double difference = 0.0;
      for (std::size_t i = 0; i < model.size(); ++i) {
        for (int k = 0; k < 40; ++k) {
          difference =
              std::max(difference, glm::length(reference::color(after, i, q * direction(k)) -
                                               reference::color(before, i, direction(k))));
        }
      }
      INFO("degree ", degree);
      CHECK(difference < 3e-6);
    }
  }
}

TEST_CASE("band matrices are orthogonal and compose") {
  const glm::dmat3 first(rotation());
  const glm::dmat3 second(glm::rotate(glm::dmat4(1.0), 2.0, glm::dvec3(0, 1, 0)));
  for (int degree = 1; degree <= 4; ++degree) {
    const auto size = static_cast<std::size_t>(2 * degree + 1);
    const std::vector<double> a = sh_band_map(degree, first);
    const std::vector<double> b = sh_band_map(degree, second);
    const std::vector<double> both = sh_band_map(degree, second * first);
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        double product = 0.0;
        double gram = 0.0;
        for (std::size_t k = 0; k < size; ++k) {
          product += b[i * size + k] * a[k * size + j];
          gram += a[k * size + i] * a[k * size + j];
        }
        // The constants of the basis are single-precision numbers.
        CHECK(std::abs(product - both[i * size + j]) < 1e-6);
        CHECK(std::abs(gram - (i == j ? 1.0 : 0.0)) < 1e-6);
      }
    }
  }
}

TEST_CASE("a moved model looks the same to the moved camera") {
  const Gaussians model = reference::random_scene(150, 5, 3);
  const Camera camera = reference::cube_camera(24, 20);
  const TraceOptions options;
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  for (const glm::dmat4& map : {rotation(), similarity(), reflection()}) {
    const reference::Render found = reference::render(
        reference::Parameters(transformed(model, map)), options, moved(camera, map));
    int compared = 0;
    for (std::size_t i = 0; i < expected.pixels(); ++i) {
      if (expected.margin[i] < 1e-4) continue;
      ++compared;
      for (std::size_t c = 0; c < 4; ++c) {
        CHECK(std::abs(found.image[c * expected.pixels() + i] -
                       expected.image[c * expected.pixels() + i]) < 2e-5);
      }
    }
    CHECK(compared > 200);
  }
}

TEST_CASE("a stretched model gives the same hits to the stretched rays") {
  const Gaussians model = reference::random_scene(150, 6, 0);
  const TraceOptions options;
  const reference::Parameters before(model);
  const reference::Parameters after(transformed(model, stretch()));
  int hits = 0;
  for (int k = 0; k < 60; ++k) {
    const glm::dvec3 origin = -4.0 * direction(k);
    const glm::dvec3 along = direction(k) + 0.1 * direction(k + 100);
    const reference::RayTrace a = reference::trace_ray(before, options, origin, along, 0.0, 100.0,
                                                       reference::ColorMode::kAlongRay);
    if (a.margin < 1e-4) continue;
    const reference::RayTrace b = reference::trace_ray(
        after, options, glm::dvec3(stretch() * glm::dvec4(origin, 1.0)),
        glm::dmat3(stretch()) * along, 0.0, 100.0, reference::ColorMode::kAlongRay);
    REQUIRE(a.hits.size() == b.hits.size());
    hits += static_cast<int>(a.hits.size());
    CHECK(glm::length(a.color - b.color) < 2e-5);
    CHECK(std::abs(a.expected_depth - b.expected_depth) < 2e-5);
  }
  CHECK(hits > 100);
}

TEST_CASE("maps that are none are refused") {
  const Gaussians model = reference::random_scene(3, 1, 1);
  glm::dmat4 flat = glm::scale(glm::dmat4(1.0), glm::dvec3(1, 0, 1));
  CHECK_THROWS_AS(transformed(model, flat), UsageError);
  glm::dmat4 perspective(1.0);
  perspective[0][3] = 0.1;
  CHECK_THROWS_AS(transformed(model, perspective), UsageError);
  glm::dmat4 infinite(1.0);
  infinite[3][0] = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(transformed(model, infinite), UsageError);
  CHECK(transformed(model, glm::dmat4(1.0)).sh == model.sh);
}

TEST_CASE("Gaussians that would be moved beyond 32-bit numbers are refused") {
  const Gaussians model = reference::random_scene(3, 1, 1);
  for (const double far : {1e39, 1e300}) {
    const glm::dmat4 map = glm::translate(glm::dmat4(1.0), glm::dvec3(0, far, 0));
    std::string told;
    try {
      transformed(model, map);
    } catch (const UsageError& error) {
      told = error.what();
    }
    INFO(told);
    CHECK(told.find("Gaussian 0 would be moved to") == 0);
  }
  const Gaussians bearable =
      transformed(model, glm::translate(glm::dmat4(1.0), glm::dvec3(0, 1e38, 0)));
  CHECK(bearable.means[1] == 1e38f);
}

TEST_CASE("joined models keep their Gaussians and take the highest degree") {
  const std::array<Gaussians, 3> models{reference::random_scene(3, 1, 1),
                                        reference::random_scene(2, 2, 3), Gaussians{}};
  const Gaussians all = joined(models);
  REQUIRE(all.size() == 5);
  CHECK(all.sh_degree == 3);
  CHECK(all.sh.size() == 5u * 16 * 3);
  const reference::Parameters p(all), a(models[0]), b(models[1]);
  for (int k = 0; k < 5; ++k) {
    CHECK(reference::color(p, 1, direction(k)) == reference::color(a, 1, direction(k)));
    CHECK(reference::color(p, 4, direction(k)) == reference::color(b, 1, direction(k)));
  }
  CHECK(p.mean(3) == b.mean(0));
  CHECK(joined({}).size() == 0);
}
