// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/mesh/mesh_builder.hpp"
#include "io/mesh/mesh_file.hpp"
#include "io/ply_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

using Names = std::vector<std::string_view>;

/// The columns of the first set of names that the file has entirely.
template <std::size_t N>
std::optional<std::array<std::size_t, N>> columns(const PlyFile& file,
                                                  std::initializer_list<Names> choices) {
  for (const Names& names : choices) {
    std::array<std::size_t, N> found{};
    bool all = true;
    for (std::size_t i = 0; i < N; ++i) {
      const auto column = file.column(names[i]);
      all = all && column.has_value();
      found[i] = column.value_or(0);
    }
    if (all) return found;
  }
  return std::nullopt;
}

template <std::size_t N>
std::array<float, N> pick(std::span<const double> row, const std::array<std::size_t, N>& from) {
  std::array<float, N> values;
  for (std::size_t i = 0; i < N; ++i) values[i] = static_cast<float>(row[from[i]]);
  return values;
}

constexpr const char* kMaterial = "default";

/// Warns of what shows on the mesh elsewhere.
void warn_of_colors(const PlyFile& file, const MeshBytes& source) {
  const std::string name = source.path.string();
  if (file.has_later("face", "texcoord")) {
    spdlog::warn(
        "{}: the texture coordinates of its faces are left out: only those of vertices are read",
        name);
  }
  if (source.seen && !source.seen(kMaterial)) return;
  if (file.column("red") || file.column("diffuse_red") || file.has_later("face", "red")) {
    spdlog::warn("{}: its colours are left out: it has those of its material", name);
  }
  if (const std::string texture = file.comment("TextureFile"); !texture.empty()) {
    spdlog::warn("{}: its texture {} is left out: a material of the scene may have it", name,
                 excerpt(texture));
  }
}

}  // namespace

MeshFile read_ply_mesh(MeshBytes source) {
  const std::filesystem::path& path = source.path;
  const PlyFile file(path, std::move(source.bytes));
  const auto position = columns<3>(file, {{"x", "y", "z"}});
  const auto normal = columns<3>(file, {{"nx", "ny", "nz"}});
  const auto uv =
      columns<2>(file, {{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"s0", "t0"}});
  if (!position) {
    throw DataError(
        fmt::format("{} has no properties x, y and z: it holds no mesh", path.string()));
  }
  MeshBuilder builder(path, source.alone ? kMostAlone : kMostTogether);
  file.for_each_row([&](std::size_t, std::span<const double> row) {
    std::optional<std::array<float, 3>> n;
    std::optional<std::array<float, 2>> t;
    if (normal) n = pick(row, *normal);
    if (uv) {
      t = pick(row, *uv);
      (*t)[1] = 1.0f - (*t)[1];  // the file's origin is the bottom left
    }
    builder.add_vertex(pick(row, *position), n, t);
  });
  std::vector<std::uint32_t> corners;
  const std::array<std::string_view, 2> names{"vertex_indices", "vertex_index"};
  const bool has_faces =
      file.for_each_list("face", names, [&](std::size_t row, std::span<const double> values) {
        if (values.size() < 3) {
          throw DataError(fmt::format("{}: face {} has {} corners, fewer than three", path.string(),
                                      row, values.size()));
        }
        corners.clear();
        for (const double value : values) {
          const bool in_range = value >= 0.0 && value < static_cast<double>(file.rows());
          if (!in_range || value != static_cast<double>(static_cast<std::uint32_t>(value))) {
            throw DataError(fmt::format("{}: face {} has the vertex {}, but there are {}",
                                        path.string(), row, value, file.rows()));
          }
          corners.push_back(static_cast<std::uint32_t>(value));
        }
        builder.add_polygon(corners, 0);
      });
  if (!has_faces) {
    throw DataError(
        fmt::format("{} has no faces (lists 'vertex_indices'): it holds no mesh", path.string()));
  }
  warn_of_colors(file, source);
  MeshFile result;
  result.bare = builder.bare();
  result.mesh = builder.finish();
  result.materials.emplace_back().name = kMaterial;
  return result;
}

}  // namespace raysplats::io
