// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <vector>

#include "raysplats/scene.hpp"

namespace raysplats {

/// An edge of a triangle by the numbers of its ends' positions, the smaller one first. Vertices at
/// equal positions have the same number.
struct MeshEdge {
  std::uint32_t low;
  std::uint32_t high;
  std::size_t low_corner;   ///< corner (3 x triangle + k) at the end `low`
  std::size_t high_corner;  ///< and at `high`
};

/// Three edges of every triangle, those between the same positions one after the other. O(T log T).
std::vector<MeshEdge> sorted_edges(const Mesh& mesh);

/// By material the number of edges of its triangles to which no other triangle comes, of whatever
/// material; ends that differ by rounding alone are one. Materials without any, whose bodies are
/// closed, are left out. O(T log T).
std::map<std::uint32_t, std::size_t> open_edges(const Mesh& mesh);

}  // namespace raysplats
