// SPDX-License-Identifier: Apache-2.0
#include "reference/gradients.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "reference/scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

constexpr double kStep = 1e-6;

/// sum of a x + b x^2 / 2 over the image with random a and b.
struct Loss {
  std::vector<double> a, b;

  Loss(std::size_t size, std::uint64_t seed) {
    CounterRng rng(seed, 9);
    for (std::size_t i = 0; i < size; ++i) {
      a.push_back(rng.normal());
      b.push_back(rng.normal());
    }
  }
  double value(const std::vector<double>& image) const {
    double sum = 0.0;
    for (std::size_t i = 0; i < image.size(); ++i) sum += image[i] * (a[i] + 0.5 * b[i] * image[i]);
    return sum;
  }
  std::vector<double> gradient(const std::vector<double>& image) const {
    std::vector<double> out(image.size());
    for (std::size_t i = 0; i < image.size(); ++i) out[i] = a[i] + b[i] * image[i];
    return out;
  }
};

/// A camera beside the cube's axis with a general rotation.
Camera tilted_camera(int width, int height) {
  Camera camera =
      look_at({1.0, -0.7, -3.5}, {0.1, 0.0, 0.0}, {0.2, -1.0, 0.1}, width, height, 1.3 * width);
  camera.fy *= 1.1;
  camera.cx += 0.3;
  return camera;
}

/// The camera about its centre, turned by exp([w]x) on the left, its centre moved by `shift`.
Camera stepped(const Camera& camera, const glm::dvec3& shift, const glm::dvec3& w) {
  Camera out = camera;
  const double angle = glm::length(w);
  if (angle > 0.0) {
    const glm::dvec3 axis = w / angle;
    glm::dmat3 turn;
    for (int k = 0; k < 3; ++k) {  // Rodrigues
      glm::dvec3 e(0.0);
      e[k] = 1.0;
      turn[k] = e * std::cos(angle) + glm::cross(axis, e) * std::sin(angle) +
                axis * glm::dot(axis, e) * (1.0 - std::cos(angle));
    }
    out.rotation = turn * camera.rotation;
  }
  out.translation = -(out.rotation * (camera.center() + shift));
  return out;
}

struct Check {
  Parameters parameters;
  TraceOptions options;
  Camera camera = tilted_camera(7, 6);
  std::size_t crossed = 0;  ///< perturbations that changed the hits: no derivative to compare with
  std::size_t compared = 0;

  void compare(double analytic,
               const Render& plus,
               const Render& minus,
               const Render& at,
               const Loss& loss,
               const std::string& what) {
    if (plus.signature != at.signature || minus.signature != at.signature) {
      ++crossed;
      return;
    }
    ++compared;
    const double numeric = (loss.value(plus.image) - loss.value(minus.image)) / (2.0 * kStep);
    INFO(what, ": analytic ", analytic, " numeric ", numeric);
    CHECK(std::abs(analytic - numeric) <= 2e-6 * (std::abs(numeric) + 0.01));
  }

  void run() {
    const Render at = render(parameters, options, camera);
    REQUIRE(at.hits > 100);
    const Loss loss(at.image.size(), 17);
    const Gradient g = render_gradient(parameters, options, camera, loss.gradient(at.image));
    for (std::size_t i = 0; i < parameters.scalar_count(); ++i) {
      Parameters plus = parameters, minus = parameters;
      plus.at(i) += kStep;
      minus.at(i) -= kStep;
      compare(g.parameters.at(i), render(plus, options, camera), render(minus, options, camera), at,
              loss, "scalar " + std::to_string(i));
    }
    for (int k = 0; k < 3; ++k) {
      glm::dvec3 step(0.0);
      step[k] = kStep;
      const glm::dvec3 none(0.0);
      compare(g.center[k], render(parameters, options, stepped(camera, step, none)),
              render(parameters, options, stepped(camera, -step, none)), at, loss,
              "center " + std::to_string(k));
      compare(g.rotation[k], render(parameters, options, stepped(camera, none, step)),
              render(parameters, options, stepped(camera, none, -step)), at, loss,
              "rotation " + std::to_string(k));
    }
    CHECK(crossed == 0);
    CHECK(compared == parameters.scalar_count() + 6);
  }
};

Check scene(std::size_t count, std::uint64_t seed, int degree, ScaleActivation activation) {
  Gaussians model = random_scene(count, seed, degree);
  for (float& s : model.log_scales) s = std::min(s, -0.3f);
  for (float& c : model.sh) c *= 0.5f;
  Check check;
  check.parameters = Parameters(model, activation);
  check.options.background = {0.3f, 0.6f, 0.1f};
  return check;
}

/// ray_gradient() against central differences over rays of any origins and directions.
void check_rays(const Check& check, ColorMode mode) {
  const Parameters& parameters = check.parameters;
  CounterRng rng(41, 8);
  std::vector<RayQuery> rays;
  for (int i = 0; i < 50; ++i) {
    RayQuery ray;
    ray.origin = glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    const glm::dvec3 target = 0.5 * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    ray.direction = (target - ray.origin) * std::exp(rng.normal());
    ray.t_min = i % 3 == 0 ? 0.2 : 0.0;
    ray.t_max = i % 4 == 0 ? ray.t_min + 1.0 : 1e30;
    rays.push_back(ray);
  }
  struct Traced {
    std::vector<double> values;       // as a Loss takes them
    std::vector<std::uint32_t> hits;  // of all rays, which must not change
  };
  const auto trace = [&](const Parameters& p) {
    Traced out;
    for (const RayQuery& ray : rays) {
      const RayTrace traced =
          trace_ray(p, check.options, ray.origin, ray.direction, ray.t_min, ray.t_max, mode);
      for (int k = 0; k < 3; ++k) out.values.push_back(traced.color[k]);
      out.values.push_back(traced.alpha);
      for (const Hit& hit : traced.hits) out.hits.push_back(hit.index);
      out.hits.push_back(0xffffffffu);
    }
    return out;
  };
  const Traced at = trace(parameters);
  REQUIRE(at.hits.size() > rays.size() + 60);
  const Loss loss(at.values.size(), 18);
  const Parameters g =
      ray_gradient(parameters, check.options, rays, loss.gradient(at.values), mode);
  std::size_t crossed = 0;
  for (std::size_t i = 0; i < parameters.scalar_count(); ++i) {
    Parameters plus = parameters, minus = parameters;
    plus.at(i) += kStep;
    minus.at(i) -= kStep;
    const Traced above = trace(plus), below = trace(minus);
    if (above.hits != at.hits || below.hits != at.hits) {
      ++crossed;
      continue;
    }
    const double numeric = (loss.value(above.values) - loss.value(below.values)) / (2.0 * kStep);
    INFO("scalar ", i, ": analytic ", g.at(i), " numeric ", numeric);
    CHECK(std::abs(g.at(i) - numeric) <= 2e-6 * (std::abs(numeric) + 0.01));
  }
  CHECK(crossed == 0);
}

}  // namespace

TEST_CASE("gradients of arbitrary rays equal finite differences") {
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const ColorMode mode : {ColorMode::kFromOrigin, ColorMode::kAlongRay}) {
      CAPTURE(static_cast<int>(order));
      CAPTURE(static_cast<int>(mode));
      Check check = scene(30, 6, 2, ScaleActivation::kExp);
      check.options.hit_order = order;
      check.options.adaptive_radius = order == HitOrder::kPeak;
      check_rays(check, mode);
    }
  }
  Check check = scene(40, 21, 1, ScaleActivation::kSigmoid);
  check.options.max_hits = 3;
  check_rays(check, ColorMode::kAlongRay);
  CHECK_THROWS_AS(ray_gradient(check.parameters, check.options, std::vector<RayQuery>(2),
                               std::vector<double>(7), ColorMode::kAlongRay),
                  UsageError);
}

TEST_CASE("gradients equal finite differences for both orders, activations and radii") {
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
      for (const bool adaptive : {false, true}) {
        CAPTURE(static_cast<int>(order));
        CAPTURE(static_cast<int>(activation));
        CAPTURE(adaptive);
        Check check = scene(30, 5, 1, activation);
        check.options.hit_order = order;
        check.options.adaptive_radius = adaptive;
        check.run();
      }
    }
  }
}

TEST_CASE("gradients equal finite differences for every SH degree") {
  for (int degree = 0; degree <= 4; ++degree) {
    CAPTURE(degree);
    scene(16, 11, degree, ScaleActivation::kExp).run();
  }
}

TEST_CASE("gradients under a sky equal finite differences, those of the pose too") {
  Check check = scene(20, 13, 1, ScaleActivation::kExp);
  CounterRng rng(5, 3);
  check.options.sky.resize(9);
  for (auto& coefficient : check.options.sky) {
    for (float& value : coefficient) value = static_cast<float>(0.2 * rng.normal());
  }
  check.run();
  check_rays(check, ColorMode::kAlongRay);
}

TEST_CASE("bands above the active degree have no gradient") {
  Check check = scene(16, 11, 3, ScaleActivation::kExp);
  check.parameters.active_sh_degree = 1;
  check.run();
}

TEST_CASE("gradients equal finite differences when a ray stops early or after max_hits") {
  Check check = scene(40, 21, 0, ScaleActivation::kExp);
  for (double& a : check.parameters.opacities) a += 2.5;
  check.options.min_transmittance = 0.05f;
  check.run();
  check = scene(40, 21, 0, ScaleActivation::kExp);
  check.options.max_hits = 3;
  check.run();
}

TEST_CASE("gradients are finite and right where alpha is one") {
  // The middle pixel's ray runs through the mean of an opaque Gaussian: alpha is exactly 1.
  Check check = scene(24, 31, 1, ScaleActivation::kExp);
  check.camera = cube_camera(5, 5);
  check.options.min_transmittance = 0.0f;
  Parameters& p = check.parameters;
  for (std::size_t k = 0; k < 3; ++k) p.means[k] = 0.0;
  p.opacities[0] = 40.0;
  p.opacities[1] = 40.0;
  const RayTrace ray =
      trace_ray(p, check.options, {0, 0, -4}, {0, 0, 1}, 0.0, 100.0, ColorMode::kFromOrigin);
  REQUIRE(ray.transmittance == 0.0);
  check.run();
}

TEST_CASE("a clamped colour has no gradient") {
  Check check = scene(16, 3, 0, ScaleActivation::kExp);
  for (std::size_t k = 0; k < 3; ++k) check.parameters.sh[k] = -5.0;
  check.run();
  const Render at = render(check.parameters, check.options, check.camera);
  const Gradient g = render_gradient(check.parameters, check.options, check.camera,
                                     std::vector<double>(at.image.size(), 1.0));
  for (std::size_t k = 0; k < 3; ++k) CHECK(g.parameters.sh[k] == 0.0);
}

TEST_CASE("an image gradient of another size is refused") {
  const Check check = scene(4, 3, 0, ScaleActivation::kExp);
  CHECK_THROWS_AS(
      render_gradient(check.parameters, check.options, check.camera, std::vector<double>(7)),
      UsageError);
}
