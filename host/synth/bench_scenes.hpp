// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/scene.hpp"

namespace raysplats {

/// Names that bench_scene() takes.
std::vector<std::string> bench_scene_names();

/// Gaussians for benchmarks, the same for a (name, count, seed) everywhere:
///   random     means uniform in [-1, 1]^3, sizes for which a ray of bench_camera() blends about 42
///              whatever the count
///   clustered  means in a few hundred dense clumps of [-1, 1]^3 with sizes that differ a
///              hundredfold: uneven tiles, overlapping boxes
///   surface    thin Gaussians that tile the faces of objects in [-1, 1]^3, mostly opaque
/// SH degree `sh_degree`. Throws UsageError for other names and for a count of 0.
Gaussians bench_scene(const std::string& name,
                      std::size_t count,
                      std::uint64_t seed,
                      int sh_degree = 0);

/// Camera at (0, 0, -4) that looks along +z; the front face of [-1, 1]^3 fills the image.
Camera bench_camera(int width, int height);

/// Rays without coherence that all cross [-1, 1]^3: each passes through a uniform point of the cube
/// in a uniform direction of length 1, and starts 4 units before that point, outside the cube.
std::vector<Ray> bench_rays(std::size_t count, std::uint64_t seed);

/// A closed body with bumps: a grid of n x 2 n cells on a sphere, two triangles each, as many as
/// come nearest to `triangles` (at least 8), with smooth normals and material 0.
Mesh bench_body(std::size_t triangles, const std::array<double, 3>& center, double radius);

}  // namespace raysplats
