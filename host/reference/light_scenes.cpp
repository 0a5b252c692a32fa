// SPDX-License-Identifier: Apache-2.0
#include "reference/light_scenes.hpp"

#include <cmath>
#include <numbers>

#include "reference/scenes.hpp"

namespace raysplats::reference {
namespace {

constexpr double kPi = std::numbers::pi;

std::uint32_t add_corner(Mesh& mesh, const glm::dvec3& p) {
  for (int k = 0; k < 3; ++k) mesh.positions.push_back(static_cast<float>(p[k]));
  return static_cast<std::uint32_t>(mesh.vertex_count() - 1);
}

void add_triangle(
    Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint32_t material) {
  mesh.triangles.insert(mesh.triangles.end(), {a, b, c});
  mesh.materials.push_back(material);
}

}  // namespace

Mesh rectangle(const glm::dvec3& center,
               const glm::dvec3& u,
               const glm::dvec3& v,
               std::uint32_t material) {
  Mesh mesh;
  const std::uint32_t a = add_corner(mesh, center - u - v);
  const std::uint32_t b = add_corner(mesh, center + u - v);
  const std::uint32_t c = add_corner(mesh, center + u + v);
  const std::uint32_t d = add_corner(mesh, center - u + v);
  mesh.uvs = {0, 0, 1, 0, 1, 1, 0, 1};
  add_triangle(mesh, a, b, c, material);
  add_triangle(mesh, a, c, d, material);
  return mesh;
}

Mesh box(const glm::dvec3& low, const glm::dvec3& high, std::uint32_t material) {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    add_corner(mesh, {i & 1 ? high.x : low.x, i & 2 ? high.y : low.y, i & 4 ? high.z : low.z});
  }
  // Four corners of each side, seen from outside in positive sense.
  constexpr std::uint32_t kSides[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& side : kSides) {
    add_triangle(mesh, side[0], side[1], side[2], material);
    add_triangle(mesh, side[0], side[2], side[3], material);
  }
  return mesh;
}

Mesh ball(const glm::dvec3& center, double radius, int rings, std::uint32_t material, bool smooth) {
  Mesh mesh;
  const int spokes = 2 * rings;
  const auto add = [&](const glm::dvec3& n) {
    if (smooth) {
      for (int k = 0; k < 3; ++k) mesh.normals.push_back(static_cast<float>(n[k]));
    }
    return add_corner(mesh, center + radius * n);
  };
  const std::uint32_t top = add({0, 1, 0});
  for (int ring = 1; ring < rings; ++ring) {
    const double polar = kPi * ring / rings;
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double azimuth = 2.0 * kPi * spoke / spokes;
      add({std::sin(polar) * std::sin(azimuth), std::cos(polar),
           std::sin(polar) * std::cos(azimuth)});
    }
  }
  const std::uint32_t bottom = add({0, -1, 0});
  const auto corner = [&](int ring, int spoke) {
    return static_cast<std::uint32_t>(1 + (ring - 1) * spokes + spoke % spokes);
  };
  for (int spoke = 0; spoke < spokes; ++spoke) {
    add_triangle(mesh, top, corner(1, spoke), corner(1, spoke + 1), material);
    for (int ring = 1; ring + 1 < rings; ++ring) {
      const std::uint32_t a = corner(ring, spoke), b = corner(ring, spoke + 1);
      const std::uint32_t c = corner(ring + 1, spoke), d = corner(ring + 1, spoke + 1);
      add_triangle(mesh, a, c, d, material);
      add_triangle(mesh, a, d, b, material);
    }
    add_triangle(mesh, bottom, corner(rings - 1, spoke + 1), corner(rings - 1, spoke), material);
  }
  return mesh;
}

void add_gaussian(Gaussians& model,
                  const glm::dvec3& mean,
                  double sigma,
                  double opacity,
                  const glm::dvec3& color) {
  const std::size_t i = model.size();
  model.resize(i + 1);
  for (std::size_t k = 0; k < 3; ++k) {
    model.means[3 * i + k] = static_cast<float>(mean[static_cast<int>(k)]);
    model.log_scales[3 * i + k] = static_cast<float>(std::log(sigma));
    model.sh[3 * i + k] =
        static_cast<float>((color[static_cast<int>(k)] - 0.5) * std::sqrt(4.0 * kPi));
  }
  model.opacities[i] = static_cast<float>(std::log(opacity / (1.0 - opacity)));
}

Gaussians gaussian_cloud(std::size_t count,
                         std::uint64_t seed,
                         const glm::dvec3& low,
                         const glm::dvec3& high,
                         double sigma,
                         int sh_degree) {
  Gaussians out = random_scene(count, seed, sh_degree);
  const double shrink = std::log(sigma / (2.4 / std::sqrt(static_cast<double>(count))));
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const int axis = static_cast<int>(k);
      out.means[3 * i + k] = static_cast<float>(low[axis] + (high[axis] - low[axis]) * 0.5 *
                                                                (out.means[3 * i + k] + 1.0));
      out.log_scales[3 * i + k] += static_cast<float>(shrink);
    }
  }
  return out;
}

Material white(Material::Kind kind) {
  Material out;
  out.kind = kind;
  out.color = {1.0f, 1.0f, 1.0f};
  return out;
}

Material glass(float ior) {
  Material out = white(Material::Kind::kGlass);
  out.ior = ior;
  return out;
}

}  // namespace raysplats::reference
