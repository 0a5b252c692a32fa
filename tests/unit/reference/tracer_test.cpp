// SPDX-License-Identifier: Apache-2.0
#include "reference/tracer.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "reference/scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// A Gaussian of one colour with equal scales at `mean`.
void add_ball(Parameters& p,
              const glm::dvec3& mean,
              double sigma,
              double opacity_logit,
              const glm::dvec3& rgb) {
  for (int k = 0; k < 3; ++k) p.means.push_back(mean[k]);
  for (int k = 0; k < 4; ++k) p.quaternions.push_back(k == 0 ? 1.0 : 0.0);
  for (int k = 0; k < 3; ++k) p.scales.push_back(std::log(sigma));
  p.opacities.push_back(opacity_logit);
  for (int k = 0; k < 3; ++k)
    p.sh.push_back((rgb[k] - 0.5) * std::sqrt(4.0 * 3.14159265358979323846));
}

RayTrace trace_z(const Parameters& p, const TraceOptions& options, const glm::dvec3& origin) {
  return trace_ray(p, options, origin, {0, 0, 1}, 0.0, kInfinity, ColorMode::kFromOrigin);
}

/// The hits of a ray by another road: covariance, its inverse by cofactors, the expanded quadratic
/// A t^2 + 2 B t + C = Q and its textbook roots, all in long double; blended by definition.
struct Expanded {
  std::vector<std::pair<long double, std::size_t>> hits;  // key, index
  long double transmittance = 1.0L;
  long double color[3] = {0, 0, 0};
};

Expanded trace_expanded(const Gaussians& model,
                        const TraceOptions& options,
                        const glm::dvec3& origin,
                        const glm::dvec3& direction) {
  struct Item {
    long double key, alpha;
    std::size_t index;
  };
  std::vector<Item> items;
  for (std::size_t i = 0; i < model.size(); ++i) {
    long double q[4], n = 0;
    for (std::size_t k = 0; k < 4; ++k) q[k] = model.quaternions[4 * i + k];
    for (const long double c : q) n += c * c;
    for (long double& c : q) c /= std::sqrt(n);
    const auto [r, x, y, z] = q;
    const long double R[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - r * z), 2 * (x * z + r * y)},
        {2 * (x * y + r * z), 1 - 2 * (x * x + z * z), 2 * (y * z - r * x)},
        {2 * (x * z - r * y), 2 * (y * z + r * x), 1 - 2 * (x * x + y * y)}};
    long double S[3][3] = {};
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        for (std::size_t k = 0; k < 3; ++k) {
          S[a][b] += R[a][k] * std::exp(2.0L * model.log_scales[3 * i + k]) * R[b][k];
        }
      }
    }
    long double inverse[3][3];
    for (std::size_t a = 0; a < 3; ++a) {
      for (std::size_t b = 0; b < 3; ++b) {
        const std::size_t a1 = (a + 1) % 3, a2 = (a + 2) % 3, b1 = (b + 1) % 3, b2 = (b + 2) % 3;
        inverse[b][a] = S[a1][b1] * S[a2][b2] - S[a1][b2] * S[a2][b1];
      }
    }
    const long double det =
        S[0][0] * inverse[0][0] + S[0][1] * inverse[1][0] + S[0][2] * inverse[2][0];
    long double A = 0, B = 0, C = 0;
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        const long double e = inverse[a][b] / det;
        const long double oa = origin[a] - model.means[3 * i + static_cast<std::size_t>(a)];
        const long double ob = origin[b] - model.means[3 * i + static_cast<std::size_t>(b)];
        A += direction[a] * e * direction[b];
        B += oa * e * direction[b];
        C += oa * e * ob;
      }
    }
    const long double sigma =
        1.0L / (1.0L + std::exp(-static_cast<long double>(model.opacities[i])));
    long double Q = options.quantile;
    if (options.adaptive_radius) Q = std::min(Q, 2.0L * std::log(sigma * 255.0L));
    const long double delta2 = C - B * B / A;
    if (Q < 0 || delta2 > Q) continue;
    const long double key =
        options.hit_order == HitOrder::kPeak ? -B / A : (-B - std::sqrt(B * B - A * (C - Q))) / A;
    if (key >= 0) items.push_back({key, sigma * std::exp(-delta2 / 2), i});
  }
  std::sort(items.begin(), items.end(), [](const Item& a, const Item& b) { return a.key < b.key; });
  Expanded out;
  for (const Item& item : items) {
    if (out.transmittance < options.min_transmittance ||
        out.hits.size() == static_cast<std::size_t>(options.max_hits)) {
      break;
    }
    for (std::size_t k = 0; k < 3; ++k) {  // degree 0
      const long double c =
          0.5L + model.sh[3 * item.index + k] / std::sqrt(4.0L * 3.14159265358979323846L);
      out.color[k] += out.transmittance * item.alpha * std::max(0.0L, c);
    }
    out.transmittance *= 1 - item.alpha;
    out.hits.emplace_back(item.key, item.index);
  }
  return out;
}

}  // namespace

TEST_CASE("rays meet the same Gaussians as in the expanded quadratic") {
  const Gaussians model = random_scene(400, 7, 0);
  const Parameters p(model);
  CounterRng rng(3, 1);
  std::size_t hits = 0;
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const bool adaptive : {false, true}) {
      TraceOptions options;
      options.hit_order = order;
      options.adaptive_radius = adaptive;
      for (int n = 0; n < 60; ++n) {
        // Every third origin lies amid the Gaussians.
        const double z = n % 3 == 0 ? rng.uniform() - 0.5 : -4.0;
        const glm::dvec3 origin(rng.uniform() - 0.5, rng.uniform() - 0.5, z);
        const glm::dvec3 direction(0.5 * rng.normal(), 0.5 * rng.normal(), 2.0);
        const RayTrace ray =
            trace_ray(p, options, origin, direction, 0.0, kInfinity, ColorMode::kAlongRay);
        const Expanded expected = trace_expanded(model, options, origin, direction);
        REQUIRE(ray.hits.size() == expected.hits.size());
        hits += ray.hits.size();
        for (std::size_t k = 0; k < ray.hits.size(); ++k) {
          REQUIRE(ray.hits[k].index == expected.hits[k].second);
          REQUIRE(ray.hits[k].t ==
                  doctest::Approx(static_cast<double>(expected.hits[k].first)).epsilon(1e-9));
        }
        CHECK(ray.transmittance ==
              doctest::Approx(static_cast<double>(expected.transmittance)).epsilon(1e-9));
        for (int k = 0; k < 3; ++k) {
          CHECK(ray.color[k] ==
                doctest::Approx(static_cast<double>(expected.color[k])).epsilon(1e-9));
        }
      }
    }
  }
  CHECK(hits > 3000);  // the scene generator's promise: tens of hits per ray
}

TEST_CASE("a single Gaussian has the closed form") {
  Parameters p;
  const double logit = 0.4, sigma = 0.5, offset = 0.3;
  add_ball(p, {offset, 0, 2}, sigma, logit, {0.9, 0.4, 0.1});
  TraceOptions options;
  options.background = {0.2f, 0.3f, 0.4f};
  const RayTrace ray = trace_z(p, options, {0, 0, -3});
  const double delta2 = offset * offset / (sigma * sigma);
  const double alpha = std::exp(-0.5 * delta2) / (1.0 + std::exp(-logit));
  REQUIRE(ray.hits.size() == 1);
  CHECK(ray.alpha == doctest::Approx(alpha).epsilon(1e-13));
  CHECK(ray.color.r == doctest::Approx(0.9 * alpha + (1 - alpha) * 0.2f).epsilon(1e-13));
  CHECK(ray.color.b == doctest::Approx(0.1 * alpha + (1 - alpha) * 0.4f).epsilon(1e-13));
  const double half_chord = std::sqrt(sigma * sigma * options.quantile - offset * offset);
  CHECK(ray.hits[0].t == doctest::Approx(5.0 - half_chord).epsilon(1e-13));
  CHECK(ray.expected_depth == doctest::Approx(5.0).epsilon(1e-13));
  CHECK(ray.median_depth == (alpha > 0.5 ? doctest::Approx(5.0) : doctest::Approx(0.0)));

  // Depth is in units of |d|, everything else does not depend on it.
  const RayTrace twice =
      trace_ray(p, options, {0, 0, -3}, {0, 0, 2}, 0.0, kInfinity, ColorMode::kFromOrigin);
  CHECK(twice.expected_depth == doctest::Approx(2.5).epsilon(1e-13));
  CHECK(twice.alpha == doctest::Approx(alpha).epsilon(1e-13));
}

TEST_CASE("an origin inside misses in entry order and sees the far half in peak order") {
  Parameters p;
  add_ball(p, {0, 0, 0}, 0.5, 1.0, {1, 1, 1});
  TraceOptions options;
  CHECK(trace_z(p, options, {0, 0, -0.2}).hits.empty());
  CHECK(trace_z(p, options, {0, 0, 3}).hits.empty());
  options.hit_order = HitOrder::kPeak;
  CHECK(trace_z(p, options, {0, 0, -0.2}).hits.size() == 1);
  CHECK(trace_z(p, options, {0, 0, 0.2}).hits.empty());
}

TEST_CASE("a hit's key must lie in the ray's interval") {
  Parameters p;
  add_ball(p, {0, 0, 0}, 0.1, 1.0, {1, 1, 1});
  TraceOptions options;
  const auto count = [&](double t_min, double t_max) {
    return trace_ray(p, options, {0, 0, -2}, {0, 0, 1}, t_min, t_max, ColorMode::kAlongRay)
        .hits.size();
  };
  const double entry = 2.0 - 0.1 * std::sqrt(static_cast<double>(options.quantile));
  CHECK(count(entry - 1e-6, 10.0) == 1);
  CHECK(count(entry + 1e-6, 10.0) == 0);
  CHECK(count(0.0, entry + 1e-6) == 1);
  CHECK(count(0.0, entry - 1e-6) == 0);
  options.hit_order = HitOrder::kPeak;
  CHECK(count(1.999, 2.001) == 1);
  CHECK(count(2.001, 10.0) == 0);
}

TEST_CASE("a wall of opaque Gaussians is its colour and hides what lies behind") {
  Parameters p;
  const glm::dvec3 rgb(0.7, 0.2, 0.4);
  for (int y = -16; y <= 16; ++y) {
    for (int x = -16; x <= 16; ++x) add_ball(p, {0.1 * x, 0.1 * y, 0}, 0.1, 8.0, rgb);
  }
  add_ball(p, {0, 0, 5}, 0.5, 8.0, {0.0, 1.0, 0.0});
  TraceOptions options;
  const Render image = render(p, options, cube_camera(9, 9));
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    CHECK(image.image[3 * image.pixels() + i] > 1.0 - options.min_transmittance);
    for (std::size_t k = 0; k < 3; ++k) {
      // The colour is the wall's times the alpha: no energy appears or is lost.
      CHECK(image.image[k * image.pixels() + i] ==
            doctest::Approx(rgb[static_cast<int>(k)] * image.image[3 * image.pixels() + i])
                .epsilon(2e-4));
    }
    CHECK(image.depth[i] == doctest::Approx(4.0).epsilon(0.02));
  }
  CHECK(image.capped_rays == 0);
}

TEST_CASE("a Gaussian split in two of equal place keeps the picture") {
  // 1 - alpha = (1 - half)^2 on the axis, where the response is 1.
  Parameters one, two;
  const double alpha = 0.6, half = 1.0 - std::sqrt(1.0 - alpha);
  add_ball(one, {0, 0, 0}, 0.4, std::log(alpha / (1 - alpha)), {0.3, 0.6, 0.9});
  for (int k = 0; k < 2; ++k)
    add_ball(two, {0, 0, 0}, 0.4, std::log(half / (1 - half)), {0.3, 0.6, 0.9});
  TraceOptions options;
  options.background = {0.5f, 0.25f, 0.125f};
  const RayTrace a = trace_z(one, options, {0, 0, -2});
  const RayTrace b = trace_z(two, options, {0, 0, -2});
  CHECK(b.hits.size() == 2);
  CHECK(b.hits[0].index == 0);  // equal keys: ascending index
  CHECK(b.hits[1].index == 1);
  CHECK(a.alpha == doctest::Approx(b.alpha).epsilon(1e-12));
  for (int k = 0; k < 3; ++k) CHECK(a.color[k] == doctest::Approx(b.color[k]).epsilon(1e-12));
}

TEST_CASE("white Gaussians before a white background give exactly white") {
  Gaussians model = random_scene(300, 5, 0);
  for (float& c : model.sh) c = 0.5f * std::sqrt(4.0f * 3.14159265f);
  TraceOptions options;
  options.background = {1.0f, 1.0f, 1.0f};
  const Render image = render(Parameters(model), options, cube_camera(8, 6));
  for (std::size_t i = 0; i < 3 * image.pixels(); ++i)
    CHECK(image.image[i] == doctest::Approx(1.0).epsilon(1e-6));
}

TEST_CASE("a ray stops after the hit that crosses the threshold or after max_hits") {
  Parameters p;
  for (int k = 0; k < 6; ++k) add_ball(p, {0, 0, k}, 0.1, 0.0, {1, 1, 1});  // alpha = 1/2 each
  TraceOptions options;
  options.min_transmittance = 0.2f;
  RayTrace ray = trace_z(p, options, {0, 0, -2});
  CHECK(ray.hits.size() == 3);  // 1/2, 1/4, 1/8
  CHECK(ray.alpha == doctest::Approx(0.875));
  CHECK(!ray.capped);
  CHECK(ray.median_depth == doctest::Approx(3.0));  // 1/2 is not below 1/2

  options.max_hits = 2;
  ray = trace_z(p, options, {0, 0, -2});
  CHECK(ray.hits.size() == 2);
  CHECK(ray.capped);
  options.max_hits = 3;
  CHECK(!trace_z(p, options, {0, 0, -2}).capped);  // the threshold ended it
  options.min_transmittance = 1e-4f;
  options.max_hits = 6;
  CHECK(!trace_z(p, options, {0, 0, -2}).capped);  // there was nothing more
}

TEST_CASE("an adaptive radius cuts where the response falls below 1/255") {
  Parameters p;
  const double opacity = 0.02;
  add_ball(p, {0, 0, 0}, 1.0, std::log(opacity / (1 - opacity)), {1, 1, 1});
  add_ball(p, {0, 0, 9}, 1.0, std::log(0.003 / 0.997), {1, 1, 1});  // below 1/255: never met
  TraceOptions options;
  const double edge = std::sqrt(2.0 * std::log(255.0 * opacity));
  CHECK(trace_z(p, options, {edge + 1e-6, 0, -5}).hits.size() == 2);
  options.adaptive_radius = true;
  CHECK(trace_z(p, options, {edge + 1e-6, 0, -5}).hits.empty());
  const RayTrace ray = trace_z(p, options, {edge - 1e-6, 0, -5});
  REQUIRE(ray.hits.size() == 1);
  CHECK(ray.hits[0].alpha == doctest::Approx(1.0 / 255.0).epsilon(1e-5));
}

TEST_CASE("near_depth hides Gaussians by the depth of their mean") {
  Parameters p;
  add_ball(p, {0, 0, -1}, 0.1, 1.0, {1, 1, 1});
  add_ball(p, {0, 0, 1}, 0.1, 1.0, {1, 1, 1});
  TraceOptions options;
  const Camera camera = cube_camera(1, 1);
  CHECK(render(p, options, camera).hits == 2);
  options.near_depth = 2.9f;
  CHECK(render(p, options, camera).hits == 2);
  options.near_depth = 3.1f;
  CHECK(render(p, options, camera).hits == 1);
  options.near_depth = 5.1f;
  CHECK(render(p, options, camera).hits == 0);
}
