// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <span>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// The model under x -> A x + t, for any invertible A: rotations, uniform and other scales, shears
/// and reflections. Means and covariances map exactly (A C A^T); where A is a rotation times a
/// number the three axes keep their order and only the quaternion and the scales' logarithm change.
/// A colour seen along n in the model is seen along Q n in the result, Q being the orthogonal
/// factor of A (polar decomposition), up to degree 4 and for reflections too; clamping and the
/// order of hits stay as they are. Throws UsageError for a map that is not finite, has another last
/// row than 0 0 0 1, or flattens space.
Gaussians transformed(Gaussians model, const glm::dmat4& map);

/// A light by direction under the same map, of which only Q counts. Throws as the other.
SkyLight transformed(const SkyLight& light, const glm::dmat4& map);

/// All models one after the other, with the highest of their SH degrees.
Gaussians joined(std::span<const Gaussians> models);

/// The orthogonal factor of an invertible matrix: its nearest rotation, or rotation with a
/// reflection (Newton's iteration, Higham 1986).
glm::dmat3 orthogonal_factor(const glm::dmat3& matrix);

/// Per band of degree `degree`, the (2 d + 1)^2 row-major matrix D with
/// coefficients' = D coefficients, for which the function f'(n) = f(Q^T n) of any orthogonal Q.
std::vector<double> sh_band_map(int degree, const glm::dmat3& orthogonal);

}  // namespace raysplats
