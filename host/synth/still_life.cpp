// SPDX-License-Identifier: Apache-2.0
// The objects and procedural materials of the generated scene.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "synth/noise.hpp"
#include "synth/scene.hpp"
#include "util/rng.hpp"

namespace raysplats::synth {

namespace {

using glm::dvec3;

constexpr double kPi = std::numbers::pi;
constexpr double kTableTop = -0.72;
constexpr double kTableRadius = 0.92;
constexpr double kVaseHeight = 0.82;
const dvec3 kVaseFoot{-0.30, 0.18, kTableTop};

/// Linear colour of a displayed one: the inverse of the square root in Scene::trace().
dvec3 displayed(double r, double g, double b) { return {r * r, g * g, b * b}; }

dvec3 blend(const dvec3& a, const dvec3& b, double weight) { return a + (b - a) * weight; }

/// 0 below edge - width, 1 above edge + width, smooth between.
double step_at(double edge, double width, double value) {
  const double t = std::clamp((value - edge + width) / (2.0 * width), 0.0, 1.0);
  return t * t * (3.0 - 2.0 * t);
}

Material plain(const dvec3& color, double specular, double exponent) {
  return {.albedo = [color](const dvec3&) { return color; },
          .specular = specular,
          .exponent = exponent};
}

/// A checkered field of stone inside a turned wooden rim.
Material table_material(const Noise& noise) {
  const auto albedo = [noise](const dvec3& p) {
    const double radius = std::sqrt(p.x * p.x + p.y * p.y);
    if (radius > 0.78 || p.z < kTableTop - 1e-6) {
      const double grain =
          0.5 + 0.5 * std::sin(90.0 * radius + 6.0 * noise.fractal(p * 3.0, 2) + 40.0 * p.z);
      return blend(displayed(0.50, 0.30, 0.17), displayed(0.66, 0.44, 0.26), grain);
    }
    const auto column = static_cast<int>(std::floor(p.x / 0.195));
    const auto row = static_cast<int>(std::floor(p.y / 0.195));
    const double vein = 0.5 + 0.5 * noise.fractal(p * 7.0, 4);
    if (((column + row) & 1) == 0) {
      return blend(displayed(0.93, 0.89, 0.80), displayed(0.76, 0.70, 0.60), vein);
    }
    return blend(displayed(0.18, 0.27, 0.34), displayed(0.32, 0.42, 0.48), vein);
  };
  return {.albedo = albedo, .specular = 0.06, .exponent = 24.0};
}

/// White glaze with blue bands, a zigzag around the belly and a dotted neck.
Material vase_material(const Noise& noise) {
  const auto albedo = [noise](const dvec3& p) {
    const double u = p.z / kVaseHeight + 0.5;
    const double turn = std::atan2(p.y, p.x) / (2.0 * kPi);
    const double cloud = noise.fractal(p * 9.0, 3);
    const dvec3 glaze =
        blend(displayed(0.95, 0.93, 0.87), displayed(0.82, 0.84, 0.85), 0.5 + 0.5 * cloud);
    const dvec3 blue =
        blend(displayed(0.10, 0.20, 0.52), displayed(0.18, 0.34, 0.66), 0.5 + 0.5 * cloud);
    double ink = 0.0;
    for (const double band : {0.06, 0.20, 0.60, 0.95}) {
      ink = std::max(ink, 1.0 - step_at(0.014, 0.004, std::abs(u - band)));
    }
    const double zigzag = 2.0 * std::abs(turn * 12.0 - std::floor(turn * 12.0) - 0.5);
    if (u > 0.22 && u < 0.58) {
      ink = std::max(ink, 1.0 - step_at(0.045, 0.01, std::abs(u - 0.28 - 0.24 * zigzag)));
    }
    const double cell = turn * 16.0 - std::floor(turn * 16.0) - 0.5;
    const double dot = std::hypot(cell * 0.11, u - 0.72);
    ink = std::max(ink, 1.0 - step_at(0.03, 0.005, dot));
    return blend(glaze, blue, ink);
  };
  return {.albedo = albedo, .specular = 0.22, .exponent = 60.0};
}

/// Veined stone: a sine whose phase is stirred by noise (Perlin 1985).
Material marble_material(const Noise& noise) {
  const auto albedo = [noise](const dvec3& p) {
    const double wave = std::sin(16.0 * (p.x + 0.6 * p.z) + 5.0 * noise.fractal(p * 6.0, 4));
    const double vein = std::pow(0.5 + 0.5 * wave, 3.0);
    return blend(displayed(0.30, 0.52, 0.44), displayed(0.92, 0.94, 0.86), vein);
  };
  return {.albedo = albedo, .specular = 0.25, .exponent = 48.0};
}

/// Stripes that wind around a torus.
Material stripes_material() {
  const auto albedo = [](const dvec3& p) {
    const double ring = std::atan2(p.y, p.x);
    const double tube = std::atan2(p.z, std::sqrt(p.x * p.x + p.y * p.y) - 0.20);
    const double stripe = step_at(0.0, 0.12, std::sin(10.0 * ring + 2.0 * tube));
    return blend(displayed(0.92, 0.50, 0.14), displayed(0.36, 0.12, 0.16), stripe);
  };
  return {.albedo = albedo, .specular = 0.18, .exponent = 30.0};
}

/// A checkered globe.
Material globe_material() {
  const auto albedo = [](const dvec3& p) {
    const double longitude = std::atan2(p.y, p.x) / (2.0 * kPi);
    const double latitude = std::atan2(p.z, std::sqrt(p.x * p.x + p.y * p.y)) / kPi;
    const auto column = static_cast<int>(std::floor(longitude * 10.0));
    const auto row = static_cast<int>(std::floor(latitude * 6.0));
    return ((column + row) & 1) == 0 ? displayed(0.85, 0.16, 0.18) : displayed(0.95, 0.86, 0.62);
  };
  return {.albedo = albedo, .specular = 0.25, .exponent = 50.0};
}

Material leaf_material() {
  const auto albedo = [](const dvec3& p) {
    const double across = std::abs(p.y);
    const double rib = 1.0 - step_at(0.07, 0.03, across);
    const double phase = p.x * 8.0 - across * 1.6;
    const double side = 1.0 - step_at(0.12, 0.06, std::abs(phase - std::floor(phase) - 0.5));
    return blend(displayed(0.22, 0.50, 0.18), displayed(0.66, 0.80, 0.38),
                 std::max(rib, 0.6 * side));
  };
  return {.albedo = albedo, .specular = 0.10, .exponent = 20.0, .translucency = 0.6};
}

/// Petal streaks from pole to pole, darker to the middle.
Material blossom_material(const dvec3& outer, const dvec3& inner) {
  const auto albedo = [outer, inner](const dvec3& p) {
    const double streak = 0.5 + 0.5 * std::cos(9.0 * std::atan2(p.y, p.x));
    return blend(inner, outer, 0.25 + 0.75 * streak);
  };
  return {.albedo = albedo, .specular = 0.08, .exponent = 16.0};
}

/// Points of a quadratic Bezier curve.
std::vector<dvec3> bend(const dvec3& from, const dvec3& through, const dvec3& to, int segments) {
  std::vector<dvec3> points;
  for (int i = 0; i <= segments; ++i) {
    const double t = static_cast<double>(i) / segments;
    points.push_back((1 - t) * (1 - t) * from + 2 * t * (1 - t) * through + t * t * to);
  }
  return points;
}

/// A leaf from `base` along `direction`, its face turned as far up as it goes.
Pose leaf_pose(const dvec3& base, const dvec3& direction) {
  const dvec3 x = glm::normalize(direction);
  const dvec3 y = glm::normalize(glm::cross(dvec3(0, 0, 1), x));
  return {.rotation = {x, y, glm::cross(x, y)}, .translation = base};
}

class Builder {
 public:
  template <typename S, typename... Args>
  void add(Material material, Args&&... args) {
    objects_.push_back({std::make_unique<S>(std::forward<Args>(args)...), std::move(material)});
  }
  std::vector<Object> take() { return std::move(objects_); }

 private:
  std::vector<Object> objects_;
};

void add_bouquet(Builder& builder) {
  const Material stem = plain(displayed(0.30, 0.52, 0.22), 0.05, 20.0);
  const dvec3 mouth = kVaseFoot + dvec3(0, 0, kVaseHeight - 0.1);
  const dvec3 low = kVaseFoot + dvec3(0, 0, 0.25);
  const dvec3 tips[] = {{-0.62, 0.30, 0.60}, {-0.28, 0.02, 0.80}, {0.06, 0.42, 0.62}};
  const Material blossoms[] = {
      blossom_material(displayed(0.92, 0.42, 0.56), displayed(0.62, 0.12, 0.34)),
      blossom_material(displayed(0.97, 0.80, 0.24), displayed(0.80, 0.46, 0.10)),
      blossom_material(displayed(0.66, 0.52, 0.86), displayed(0.34, 0.22, 0.58))};
  const double radii[] = {0.085, 0.095, 0.075};
  for (int i = 0; i < 3; ++i) {
    const dvec3 sway = mouth + 0.25 * (tips[i] - mouth) + dvec3(0, 0, 0.22);
    builder.add<Wire>(stem, bend(low, sway, tips[i], 8), 0.013);
    builder.add<Sphere>(blossoms[i], tips[i], radii[i]);
  }
  const Material leaf = leaf_material();
  builder.add<Leaf>(leaf, leaf_pose(mouth + dvec3(-0.06, -0.05, 0.18), {-0.50, -0.75, 0.35}), 0.42,
                    0.17);
  builder.add<Leaf>(leaf, leaf_pose(mouth + dvec3(0.08, 0.06, 0.20), {0.85, -0.15, 0.30}), 0.40,
                    0.16);
  builder.add<Leaf>(leaf, leaf_pose(mouth + dvec3(-0.05, 0.07, 0.15), {-0.35, 0.80, 0.10}), 0.38,
                    0.15);
}

/// A thin brass hoop on a rod, with a globe that hangs in it by a thread.
void add_hoop(Builder& builder) {
  const Material brass = plain(displayed(0.80, 0.62, 0.28), 0.45, 40.0);
  const dvec3 center{0.30, 0.52, 0.10};
  constexpr double kHoopRadius = 0.26;
  const Pose pose{.rotation = frame_along({0.55, 0.80, 0.0}), .translation = center};
  builder.add<Torus>(brass, pose, kHoopRadius, 0.014);
  builder.add<Wire>(
      brass, std::vector<dvec3>{{center.x, center.y, kTableTop}, center - dvec3(0, 0, kHoopRadius)},
      0.018);
  builder.add<Wire>(
      plain(displayed(0.25, 0.25, 0.28), 0.0, 1.0),
      std::vector<dvec3>{center + dvec3(0, 0, kHoopRadius), center + dvec3(0, 0, 0.08)}, 0.008);
  builder.add<Sphere>(globe_material(), center, 0.10);
}

void add_pebbles(Builder& builder, std::uint64_t seed) {
  CounterRng rng(seed, 7);
  for (int i = 0; i < 6; ++i) {
    const double radius = 0.035 + 0.03 * rng.uniform();
    // The free part of the table, between the vase, the torus and the rim.
    const double angle = kPi * (0.93 + 0.1 * i + 0.05 * rng.uniform());
    const double distance = 0.60 + 0.12 * rng.uniform();
    const double tint = rng.uniform();
    builder.add<Sphere>(
        plain(blend(displayed(0.30, 0.62, 0.72), displayed(0.86, 0.66, 0.46), tint), 0.2, 30.0),
        dvec3(distance * std::cos(angle), distance * std::sin(angle), kTableTop + radius), radius);
  }
}

/// Five spokes of wire that meet in one point.
void add_tripod(Builder& builder) {
  const Material steel = plain(displayed(0.62, 0.66, 0.70), 0.4, 40.0);
  const dvec3 apex{-0.30, -0.42, -0.22};
  for (int i = 0; i < 5; ++i) {
    const double angle = 2.0 * kPi * i / 5.0 + 0.3;
    const dvec3 foot{apex.x + 0.17 * std::cos(angle), apex.y + 0.17 * std::sin(angle), kTableTop};
    builder.add<Wire>(steel, std::vector<dvec3>{foot, apex}, 0.010);
  }
  builder.add<Sphere>(plain(displayed(0.20, 0.55, 0.60), 0.35, 60.0), apex + dvec3(0, 0, 0.055),
                      0.06);
}

}  // namespace

Scene make_still_life(std::uint64_t seed, Backdrop backdrop) {
  const Noise noise(CounterRng(seed, 1).bits());
  Builder builder;
  builder.add<Disc>(table_material(noise), kTableRadius, kTableTop - 0.07, kTableTop);
  builder.add<Vase>(vase_material(noise), kVaseFoot + dvec3(0, 0, 0.5 * kVaseHeight), kVaseHeight);
  add_bouquet(builder);
  add_hoop(builder);
  builder.add<Sphere>(marble_material(noise), dvec3(0.16, -0.50, kTableTop + 0.19), 0.19);
  const Pose lean{.rotation = frame_along({0.95, 0.10, 0.45}),
                  .translation = {0.54, -0.04, kTableTop + 0.255}};
  builder.add<Torus>(stripes_material(), lean, 0.20, 0.075);
  add_tripod(builder);
  add_pebbles(builder, seed);
  return Scene(builder.take(), std::move(backdrop));
}

}  // namespace raysplats::synth
