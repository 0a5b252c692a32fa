// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/mesh_edges.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <unordered_map>
#include <utility>

namespace raysplats {
namespace {

using Key = std::array<std::uint32_t, 3>;
using Cell = std::array<std::int64_t, 3>;

struct WordsHash {
  template <class Word>
  std::size_t operator()(const std::array<Word, 3>& words) const {
    std::uint64_t hash = 0;
    for (const Word word : words) {
      hash = (hash ^ static_cast<std::uint64_t>(word)) * 0x9e3779b97f4a7c15ull;
      hash ^= hash >> 29;
    }
    return static_cast<std::size_t>(hash);
  }
};

/// Per vertex the number of its position: equal positions have equal numbers.
std::vector<std::uint32_t> position_numbers(const Mesh& mesh) {
  std::unordered_map<Key, std::uint32_t, WordsHash> numbers;
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

/// Vertices that stand for those within `near`, which is positive, of them along every axis.
class NearVertices {
 public:
  NearVertices(std::span<const float> positions, const std::array<double, 3>& near)
      : positions_(positions), near_(near) {
    firsts_.reserve(positions.size() / 3);
  }
  /// The one that stands for vertex i; i itself, from now on, where there is none.
  std::size_t first(std::size_t i) {
    const Cell from = cell(i, -1.0), to = cell(i, 1.0);
    Cell at;
    for (at[0] = from[0]; at[0] <= to[0]; ++at[0]) {
      for (at[1] = from[1]; at[1] <= to[1]; ++at[1]) {
        for (at[2] = from[2]; at[2] <= to[2]; ++at[2]) {
          const auto [begin, end] = firsts_.equal_range(at);
          const auto found =
              std::find_if(begin, end, [&](const auto& each) { return is_near(i, each.second); });
          if (found != end) return found->second;
        }
      }
    }
    firsts_.emplace(cell(i, 0.0), i);
    return i;
  }

 private:
  // So wide that few positions lie nearer to a cell's border than they may lie to each other.
  static constexpr double kWidth = 64;       // times `near`
  static constexpr double kFarthest = 1e18;  // cells, which an integer holds

  // Of the place that is `moved` times `near` away.
  Cell cell(std::size_t i, double moved) const {
    Cell out;
    for (std::size_t c = 0; c < 3; ++c) {
      const double position = static_cast<double>(positions_[3 * i + c]) + moved * near_[c];
      out[c] = static_cast<std::int64_t>(
          std::clamp(std::floor(position / (kWidth * near_[c])), -kFarthest, kFarthest));
    }
    return out;
  }
  bool is_near(std::size_t i, std::size_t other) const {
    for (std::size_t c = 0; c < 3; ++c) {
      const double apart = static_cast<double>(positions_[3 * i + c]) - positions_[3 * other + c];
      if (std::abs(apart) > near_[c]) return false;
    }
    return true;
  }

  std::span<const float> positions_;
  std::array<double, 3> near_;
  std::unordered_multimap<Cell, std::size_t, WordsHash> firsts_;
};

// The mesh with one vertex for those whose positions differ by rounding alone, as at the seam of a
// sphere: along every axis by less than a millionth of its longest side, or by the last digit of a
// float that is as large as its coordinates there.
Mesh joined(Mesh mesh) {
  constexpr double kRounding = 1e-6, kLastDigit = 0x1p-23;
  std::array<double, 3> near{};
  double side = 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const std::uint32_t vertex : mesh.triangles) {
      low = std::min(low, static_cast<double>(mesh.positions[3 * std::size_t{vertex} + c]));
      high = std::max(high, static_cast<double>(mesh.positions[3 * std::size_t{vertex} + c]));
    }
    side = std::max(side, high - low);
    near[c] = kLastDigit * std::max(std::abs(low), std::abs(high));
  }
  if (!(side > 0)) return mesh;
  for (double& each : near) each = std::max(each, kRounding * side);
  NearVertices vertices(mesh.positions, near);
  std::vector<std::uint32_t> firsts(mesh.vertex_count());
  for (std::size_t i = 0; i < firsts.size(); ++i)
    firsts[i] = static_cast<std::uint32_t>(vertices.first(i));
  for (std::uint32_t& vertex : mesh.triangles) vertex = firsts[vertex];
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
