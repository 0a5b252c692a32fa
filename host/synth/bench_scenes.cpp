// SPDX-License-Identifier: Apache-2.0
#include "synth/bench_scenes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "synth/shapes.hpp"
#include "util/rng.hpp"

namespace raysplats {

namespace {

/// Streams of CounterRng, one per purpose.
enum Stream : std::uint64_t { kGaussianStream, kLayoutStream, kRayStream };

/// Standard deviation times sqrt(count) for which a ray through the cube blends about 42 of the
/// `random` Gaussians before its transmittance is below 1e-3: area over count is constant.
constexpr double kSizeFactor = 2.4;
constexpr double kCameraDistance = 4.0;

glm::dvec3 uniform_in_cube(CounterRng& rng, double half_width) {
  const double x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
  return half_width * (2.0 * glm::dvec3(x, y, z) - 1.0);
}

glm::dvec3 normal_vector(CounterRng& rng) {
  const double x = rng.normal(), y = rng.normal(), z = rng.normal();
  return {x, y, z};
}

glm::dvec3 uniform_direction(CounterRng& rng) {
  const double z = 2.0 * rng.uniform() - 1.0;
  const double angle = 2.0 * std::numbers::pi * rng.uniform();
  const double radius = std::sqrt(1.0 - z * z);
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

glm::dquat random_rotation(CounterRng& rng) {
  const glm::dvec3 imaginary = normal_vector(rng);
  return glm::normalize(glm::dquat(rng.normal(), imaginary));
}

void put(Gaussians& out,
         std::size_t i,
         const glm::dvec3& mean,
         const glm::dquat& rotation,
         const glm::dvec3& log_scale,
         double opacity_logit) {
  const double q[4] = {rotation.w, rotation.x, rotation.y, rotation.z};
  for (int k = 0; k < 3; ++k) {
    out.means[3 * i + k] = static_cast<float>(mean[k]);
    out.log_scales[3 * i + k] = static_cast<float>(log_scale[k]);
  }
  for (int k = 0; k < 4; ++k) out.quaternions[4 * i + k] = static_cast<float>(q[k]);
  out.opacities[i] = static_cast<float>(opacity_logit);
}

/// Colours in the DC band uniform in +-1.5 around `base`, little in the higher bands.
void put_colors(Gaussians& out, std::size_t i, const glm::dvec3& base, CounterRng& rng) {
  const int coefficients = sh_coefficients(out.sh_degree);
  float* sh = out.sh.data() + static_cast<std::size_t>(3 * coefficients) * i;
  for (int k = 0; k < 3; ++k) sh[k] = static_cast<float>(base[k] + 1.5 * (2.0 * rng.uniform() - 1));
  for (int k = 3; k < 3 * coefficients; ++k) sh[k] = static_cast<float>(0.2 * rng.normal());
}

void fill_random(Gaussians& out, std::uint64_t seed) {
  CounterRng rng(seed, kGaussianStream);
  const double log_size = std::log(kSizeFactor / std::sqrt(static_cast<double>(out.size())));
  for (std::size_t i = 0; i < out.size(); ++i) {
    const glm::dvec3 mean = uniform_in_cube(rng, 1.0);
    const glm::dquat rotation = random_rotation(rng);
    const glm::dvec3 log_scale = log_size + 0.5 * normal_vector(rng);
    put(out, i, mean, rotation, log_scale, -1.5 + 1.5 * rng.normal());
    put_colors(out, i, glm::dvec3(0.0), rng);
  }
}

/// `x` folded back into [-1, 1] as by mirrors at both ends.
double reflected(double x) {
  const double phase = std::fmod(std::abs(x + 1.0), 4.0);
  return phase <= 2.0 ? phase - 1.0 : 3.0 - phase;
}

void fill_clustered(Gaussians& out, std::uint64_t seed) {
  struct Clump {
    glm::dvec3 center;
    double radius;
  };
  std::vector<Clump> clumps(200);
  CounterRng layout(seed, kLayoutStream);
  for (Clump& clump : clumps) {
    clump.center = uniform_in_cube(layout, 1.0);
    clump.radius = 0.03 * std::exp(0.6 * layout.normal());
  }
  // A size factor log-uniform in [0.1, 10] has a mean square of 10.9; the divisor restores the
  // covered area of `random`.
  const double log_size = std::log(kSizeFactor / 3.0 / std::sqrt(static_cast<double>(out.size())));
  CounterRng rng(seed, kGaussianStream);
  for (std::size_t i = 0; i < out.size(); ++i) {
    // The square of a uniform number prefers the first clumps: populations differ as well.
    const double pick = rng.uniform();
    const Clump& clump =
        clumps[static_cast<std::size_t>(pick * pick * static_cast<double>(clumps.size()))];
    glm::dvec3 mean = clump.center + clump.radius * normal_vector(rng);
    for (int k = 0; k < 3; ++k) mean[k] = reflected(mean[k]);
    const double size = log_size + std::log(10.0) * (2.0 * rng.uniform() - 1.0);
    const glm::dquat rotation = random_rotation(rng);
    const glm::dvec3 log_scale = size + 0.3 * normal_vector(rng);
    put(out, i, mean, rotation, log_scale, -1.5 + 1.5 * rng.normal());
    put_colors(out, i, glm::dvec3(0.0), rng);
  }
}

/// A ball or a turned box.
struct Solid {
  bool ball;
  glm::dvec3 center;
  glm::dvec3 half_extent;  ///< of the box; x is the radius of a ball
  glm::dquat rotation;
  glm::dvec3 color;  ///< DC coefficients

  double area() const {
    const glm::dvec3& h = half_extent;
    return ball ? 4.0 * std::numbers::pi * h.x * h.x : 8.0 * (h.x * h.y + h.y * h.z + h.z * h.x);
  }
};

Solid random_solid(CounterRng& rng) {
  Solid solid;
  solid.ball = rng.uniform() < 0.5;
  const glm::dvec3 u = uniform_in_cube(rng, 1.0);
  solid.half_extent = 0.21 + 0.13 * u;
  const double reach = solid.ball ? solid.half_extent.x : glm::length(solid.half_extent);
  solid.center = uniform_in_cube(rng, 1.0 - reach);
  solid.rotation = random_rotation(rng);
  solid.color = uniform_in_cube(rng, 1.2);
  return solid;
}

/// A point of the surface, uniform over its area, and the outward normal there.
struct SurfacePoint {
  glm::dvec3 position, normal;
};

SurfacePoint sample_surface(const Solid& solid, CounterRng& rng) {
  if (solid.ball) {
    const glm::dvec3 normal = uniform_direction(rng);
    return {solid.center + solid.half_extent.x * normal, normal};
  }
  const glm::dvec3& h = solid.half_extent;
  const double pick = rng.uniform() * (h.y * h.z + h.z * h.x + h.x * h.y);
  const int axis = pick < h.y * h.z ? 0 : pick < h.y * h.z + h.z * h.x ? 1 : 2;
  glm::dvec3 local = h * uniform_in_cube(rng, 1.0);
  glm::dvec3 normal(0.0);
  normal[axis] = local[axis] < 0.0 ? -1.0 : 1.0;
  local[axis] = normal[axis] * h[axis];
  return {solid.center + solid.rotation * local, solid.rotation * normal};
}

void fill_surface(Gaussians& out, std::uint64_t seed) {
  std::vector<Solid> solids;
  std::vector<double> area_up_to;
  CounterRng layout(seed, kLayoutStream);
  for (int i = 0; i < 40; ++i) {
    solids.push_back(random_solid(layout));
    area_up_to.push_back((area_up_to.empty() ? 0.0 : area_up_to.back()) + solids.back().area());
  }
  // One Gaussian's share of the area is (1.2 sigma)^2: neighbours overlap enough to close the
  // surface although their means are scattered.
  const double log_size =
      std::log(std::sqrt(area_up_to.back() / static_cast<double>(out.size())) / 1.2);
  const glm::dvec3 thin(0.0, 0.0, std::log(0.05));
  CounterRng rng(seed, kGaussianStream);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double pick = rng.uniform() * area_up_to.back();
    const auto found = std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, pick);
    const Solid& solid = solids[static_cast<std::size_t>(found - area_up_to.begin())];
    const SurfacePoint point = sample_surface(solid, rng);
    const glm::dquat spin = glm::angleAxis(std::numbers::pi * rng.uniform(), glm::dvec3(0, 0, 1));
    const glm::dquat rotation = glm::quat_cast(synth::frame_along(point.normal)) * spin;
    const glm::dvec3 log_scale = log_size + thin + 0.25 * normal_vector(rng);
    put(out, i, point.position, rotation, log_scale, 3.0 + rng.normal());
    put_colors(out, i, solid.color, rng);
  }
}

struct Entry {
  const char* name;
  void (*fill)(Gaussians&, std::uint64_t);
};
constexpr Entry kScenes[] = {
    {"random", fill_random}, {"clustered", fill_clustered}, {"surface", fill_surface}};

}  // namespace

std::vector<std::string> bench_scene_names() {
  std::vector<std::string> names;
  for (const Entry& entry : kScenes) names.emplace_back(entry.name);
  return names;
}

Gaussians bench_scene(const std::string& name,
                      std::size_t count,
                      std::uint64_t seed,
                      int sh_degree) {
  const auto entry = std::find_if(std::begin(kScenes), std::end(kScenes),
                                  [&](const Entry& candidate) { return name == candidate.name; });
  if (entry == std::end(kScenes)) {
    throw UsageError(fmt::format("There is no benchmark scene \"{}\", choose one of {}.", name,
                                 fmt::join(bench_scene_names(), ", ")));
  }
  if (count == 0) {
    throw UsageError(fmt::format(
        "The benchmark scene \"{}\" needs at least one Gaussian, give a larger count.", name));
  }
  if (sh_degree < 0 || sh_degree > 4) {
    throw UsageError(fmt::format(
        "The benchmark scene \"{}\" cannot have SH degree {}, give a number from 0 to 4.", name,
        sh_degree));
  }
  Gaussians out;
  out.sh_degree = sh_degree;
  out.resize(count);
  entry->fill(out, seed);
  return out;
}

Camera bench_camera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  // The half-angle's tangent is 1/3: the front face lies 3 units before the camera.
  camera.fx = 1.5 * width;
  camera.fy = 1.5 * height;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.translation = glm::dvec3(0.0, 0.0, kCameraDistance);
  return camera;
}

std::vector<Ray> bench_rays(std::size_t count, std::uint64_t seed) {
  std::vector<Ray> rays(count);
  CounterRng rng(seed, kRayStream);
  for (Ray& ray : rays) {
    const glm::dvec3 through = uniform_in_cube(rng, 1.0);
    const glm::dvec3 direction = uniform_direction(rng);
    const glm::dvec3 origin = through - kCameraDistance * direction;
    for (int k = 0; k < 3; ++k) {
      ray.origin[k] = static_cast<float>(origin[k]);
      ray.direction[k] = static_cast<float>(direction[k]);
    }
    ray.t_min = 0.0f;
    ray.t_max = 1e30f;
  }
  return rays;
}

Mesh bench_body(std::size_t triangles, const std::array<double, 3>& center, double radius) {
  const int rows = std::max(2, static_cast<int>(std::lround(0.5 * std::sqrt(triangles))));
  const int columns = 2 * rows;
  // The poles' triangles that have no area are left in: tracers must cope with them.
  const auto point = [&](double polar, double around) {
    const double bumps = 1.0 + 0.05 * std::sin(9.0 * polar) * std::cos(11.0 * around);
    return glm::dvec3(std::sin(polar) * std::cos(around), std::cos(polar),
                      std::sin(polar) * std::sin(around)) *
           (radius * bumps);
  };
  Mesh mesh;
  for (int i = 0; i <= rows; ++i) {
    for (int j = 0; j <= columns; ++j) {
      constexpr double kStep = 1e-4;
      const double polar = std::numbers::pi * i / rows;
      const double around = 2.0 * std::numbers::pi * j / columns;
      const glm::dvec3 at = point(polar, around);
      const double inner = std::clamp(polar, kStep, std::numbers::pi - kStep);
      const glm::dvec3 normal =
          glm::normalize(glm::cross(point(inner, around + kStep) - point(inner, around - kStep),
                                    point(inner + kStep, around) - point(inner - kStep, around)));
      for (int k = 0; k < 3; ++k) {
        mesh.positions.push_back(static_cast<float>(center[static_cast<std::size_t>(k)] + at[k]));
        mesh.normals.push_back(static_cast<float>(normal[k]));
      }
    }
  }
  const auto vertex = [&](int i, int j) {
    return static_cast<std::uint32_t>(i * (columns + 1) + j);
  };
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      const std::uint32_t a = vertex(i, j), b = vertex(i, j + 1);
      const std::uint32_t c = vertex(i + 1, j), d = vertex(i + 1, j + 1);
      mesh.triangles.insert(mesh.triangles.end(), {a, b, d, a, d, c});
      mesh.materials.insert(mesh.materials.end(), 2, 0u);
    }
  }
  return mesh;
}

}  // namespace raysplats
