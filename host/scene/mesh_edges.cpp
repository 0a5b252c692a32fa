// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh_edges.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <optional>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace raysplats {
namespace {

using Key = std::array<std::uint32_t, 3>;

struct KeyHash {
  std::size_t operator()(const Key& key) const {
    std::uint64_t hash = 0;
    for (const std::uint32_t word : key) {
      hash = (hash ^ word) * 0x9e3779b97f4a7c15ull;
      hash ^= hash >> 29;
    }
    return static_cast<std::size_t>(hash);
  }
};

/// Per vertex the number of its position: equal positions have equal numbers.
std::vector<std::uint32_t> position_numbers(const Mesh& mesh) {
  std::unordered_map<Key, std::uint32_t, KeyHash> numbers;
  numbers.reserve(mesh.vertex_count());
  std::vector<std::uint32_t> result(mesh.vertex_count());
  for (std::size_t i = 0; i < result.size(); ++i) {
    Key key;
    for (std::size_t c = 0; c < 3; ++c) {
      key[c] = std::bit_cast<std::uint32_t>(mesh.positions[3 * i + c] + 0.0f);  // -0 becomes 0
    }
    result[i] = numbers.emplace(key, static_cast<std::uint32_t>(numbers.size())).first->second;
  }
  return result;
}

// The mesh with one position for those that differ by rounding alone, as at the seam of a sphere:
// by less than a millionth of its size along every axis.
Mesh joined(Mesh mesh) {
  constexpr double kRounding = 1e-6;
  // So wide that few positions lie as near to a cell's border as they may lie to each other.
  constexpr double kCell = 64;  // times that
  if (mesh.positions.empty()) return mesh;
  const auto [low, high] = std::minmax_element(mesh.positions.begin(), mesh.positions.end());
  const double near = kRounding * (static_cast<double>(*high) - *low);
  if (!(near > 0)) return mesh;
  using Cell = std::array<std::int64_t, 3>;
  struct CellHash {
    std::size_t operator()(const Cell& cell) const {
      std::uint64_t hash = 0;
      for (const std::int64_t at : cell) {
        hash = (hash ^ static_cast<std::uint64_t>(at)) * 0x9e3779b97f4a7c15ull;
        hash ^= hash >> 29;
      }
      return static_cast<std::size_t>(hash);
    }
  };
  std::unordered_multimap<Cell, std::size_t, CellHash> firsts;  // vertices that stand for others
  firsts.reserve(mesh.vertex_count());
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    float* const p = &mesh.positions[3 * i];
    Cell from, to;
    for (std::size_t c = 0; c < 3; ++c) {
      from[c] = static_cast<std::int64_t>(std::floor((p[c] - *low - near) / (kCell * near)));
      to[c] = static_cast<std::int64_t>(std::floor((p[c] - *low + near) / (kCell * near)));
    }
    const auto same = [&](std::size_t other) {
      for (std::size_t c = 0; c < 3; ++c) {
        if (std::abs(static_cast<double>(p[c]) - mesh.positions[3 * other + c]) > near)
          return false;
      }
      return true;
    };
    std::optional<std::size_t> first;
    Cell at;
    for (at[0] = from[0]; at[0] <= to[0]; ++at[0]) {
      for (at[1] = from[1]; at[1] <= to[1]; ++at[1]) {
        for (at[2] = from[2]; at[2] <= to[2] && !first; ++at[2]) {
          const auto [begin, end] = firsts.equal_range(at);
          const auto found =
              std::find_if(begin, end, [&](const auto& f) { return same(f.second); });
          if (found != end) first = found->second;
        }
      }
    }
    if (first) {
      std::copy_n(&mesh.positions[3 * *first], 3, p);
      continue;
    }
    for (std::size_t c = 0; c < 3; ++c)
      at[c] = static_cast<std::int64_t>(std::floor((p[c] - *low) / (kCell * near)));
    firsts.emplace(at, i);
  }
  return mesh;
}

}  // namespace

std::vector<MeshEdge> sorted_edges(const Mesh& mesh) {
  const std::vector<std::uint32_t> numbers = position_numbers(mesh);
  std::vector<MeshEdge> edges;
  edges.reserve(mesh.triangles.size());
  for (std::size_t triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
    for (std::size_t k = 0; k < 3; ++k) {
      std::size_t a = 3 * triangle + k;
      std::size_t b = 3 * triangle + (k + 1) % 3;
      if (numbers[mesh.triangles[a]] > numbers[mesh.triangles[b]]) std::swap(a, b);
      edges.push_back({numbers[mesh.triangles[a]], numbers[mesh.triangles[b]], a, b});
    }
  }
  std::sort(edges.begin(), edges.end(), [](const MeshEdge& a, const MeshEdge& b) {
    return std::tie(a.low, a.high, a.low_corner) < std::tie(b.low, b.high, b.low_corner);
  });
  return edges;
}

std::map<std::uint32_t, std::size_t> open_edges(const Mesh& mesh) {
  const std::vector<MeshEdge> edges = sorted_edges(joined(mesh));
  const auto alike = [](const MeshEdge& a, const MeshEdge& b) {
    return a.low == b.low && a.high == b.high;
  };
  std::map<std::uint32_t, std::size_t> open;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const MeshEdge& edge = edges[i];
    const bool shared =
        (i > 0 && alike(edges[i - 1], edge)) || (i + 1 < edges.size() && alike(edge, edges[i + 1]));
    // An edge without length is of a triangle that no ray hits.
    if (!shared && edge.low != edge.high) ++open[mesh.materials[edge.low_corner / 3]];
  }
  return open;
}

}  // namespace raysplats
