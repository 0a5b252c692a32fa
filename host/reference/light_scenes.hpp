// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "raysplats/scene.hpp"

namespace raysplats::reference {

/// The rectangle centre +- u +- v of two flat triangles with texture coordinates; its normal is u x
/// v by the right hand.
Mesh rectangle(const glm::dvec3& center,
               const glm::dvec3& u,
               const glm::dvec3& v,
               std::uint32_t material);

/// A closed box of twelve flat triangles that face outwards.
Mesh box(const glm::dvec3& low, const glm::dvec3& high, std::uint32_t material);

/// A closed sphere of `rings` x 2 rings quads (the poles: triangles) that face outwards, with its
/// exact normals at the corners where `smooth`.
Mesh ball(const glm::dvec3& center, double radius, int rings, std::uint32_t material, bool smooth);

/// Adds a Gaussian of one colour and equal standard deviations. The model's degree is 0.
void add_gaussian(Gaussians& model,
                  const glm::dvec3& mean,
                  double sigma,
                  double opacity,
                  const glm::dvec3& color);

/// `count` Gaussians with means uniform in a box, random rotations and standard deviations near
/// `sigma`.
Gaussians gaussian_cloud(std::size_t count,
                         std::uint64_t seed,
                         const glm::dvec3& low,
                         const glm::dvec3& high,
                         double sigma,
                         int sh_degree = 0);

/// A material of one kind with colour 1, for tests in which it must not lose light.
Material white(Material::Kind kind);
Material glass(float ior);

}  // namespace raysplats::reference
