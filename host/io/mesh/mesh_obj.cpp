// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <istream>
#include <optional>
#include <span>
#include <streambuf>
#include <string>
#include <string_view>
#include <unordered_map>
#include <utility>
#include <vector>

#include "io/mesh/mesh_builder.hpp"
#include "io/mesh/mesh_file.hpp"
#include "io/mesh/mtl_materials.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

/// Blanks the slashes that end a word which begins as a corner does ("7/", "7//"): behind them
/// tinyobjloader takes the next corner for a texture coordinate or a normal.
void blank_open_slashes(char* text, std::size_t end) {
  std::size_t begin = end;
  while (begin > 0 && text[begin - 1] == '/') --begin;
  if (begin > 0 && text[begin - 1] >= '0' && text[begin - 1] <= '9') {
    std::fill(text + begin, text + end, ' ');
  }
}

/// Brings what tinyobjloader does not know into a form that it does: makes blanks and line ends
/// alike, joins lines that a backslash continues, and blanks comments, behind numbers too, and a
/// byte order mark.
void normalize(std::vector<std::byte>& bytes, const std::filesystem::path& path) {
  auto* text = reinterpret_cast<char*>(bytes.data());
  const std::size_t size = bytes.size();
  const auto is = [&](std::size_t i, char c) { return i < size && text[i] == c; };
  if (std::string_view(text, size).starts_with(kByteOrderMark)) {
    std::fill_n(text, kByteOrderMark.size(), ' ');
  }
  bool comment = false;
  char first = ' ';  // letter of the line
  for (std::size_t i = 0; i < size; ++i) {
    if (is(i, '\0')) {
      throw DataError(
          fmt::format("{} is no OBJ file: it has a zero byte at byte {}", path.string(), i));
    }
    if (is(i, '\t') || is(i, '\v') || is(i, '\f')) text[i] = ' ';
    if (is(i, '\r')) text[i] = is(i + 1, '\n') ? ' ' : '\n';
    if (is(i, '\\') && !comment) {
      const std::size_t end = is(i + 1, '\r') && is(i + 2, '\n') ? i + 2 : i + 1;
      if (is(end, '\n')) std::fill(text + i, text + end + 1, ' ');
    }
    if (first == ' ') first = text[i];
    // Elsewhere it may be part of a name.
    if (is(i, '#') && (first == '#' || first == 'v' || first == 'f')) comment = true;
    const bool line_end = is(i, '\n');
    if (comment && !line_end) text[i] = ' ';
    if (first == 'f' && (line_end || is(i, ' '))) blank_open_slashes(text, i);
    if (line_end) {
      first = ' ';
      comment = false;
    }
  }
  if (first == 'f') blank_open_slashes(text, size);
}

/// Throws unless a word of a face is a corner in one of the forms 1, 1/2, 1//3 and 1/2/3:
/// tinyobjloader reads what is no number as 0, and large numbers modulo 2^32.
void check_corner(std::string_view word, const TextReader& reader) {
  std::string_view left = word;
  for (int part = 0; part < 3; ++part) {
    const std::size_t slash = std::min(left.find('/'), left.size());
    std::int32_t index = 0;
    // Only the one between two slashes may be absent.
    const bool absent = part == 1 && slash == 0 && !left.empty();
    if (!absent && !parse_number(left.substr(0, slash), index)) break;
    if (slash == left.size()) return;
    left.remove_prefix(slash + 1);
  }
  reader.fail(fmt::format("a corner is '{}', not whole numbers such as 1/2/3", excerpt(word)));
}

/// What tinyobjloader does not tell.
struct Lines {
  bool colors = false;             // of vertices: red, green and blue behind their coordinates
  std::vector<std::string> names;  // by which usemtl calls materials, in order: some versions give
                                   // a name only up to its first blank
};

/// Checks the numbers of the lines v, vt, vn and f: tinyobjloader reads what is no number as 0.
/// Reads the material files on the way, unless the file stands alone.
Lines check_lines(std::span<const std::byte> bytes,
                  const std::filesystem::path& path,
                  bool alone,
                  MtlMaterials& materials) {
  TextReader reader(bytes, path);
  const auto check = [&](const char* what, int count) {
    for (int i = 0; i < count; ++i) {
      if (std::isfinite(static_cast<float>(reader.number(what)))) continue;
      reader.fail(fmt::format("{} is not finite", what));
    }
  };
  Lines out;
  while (reader.next_line()) {
    const std::string_view key = reader.word();
    if (key == "v") {
      check("a coordinate of the vertex", 3);
      for (int i = 0; i < 2 && !out.colors; ++i) reader.word();
      out.colors = out.colors || !reader.word().empty();
    } else if (key == "vn") {
      check("a coordinate of the normal", 3);
    } else if (key == "vt") {
      check("a texture coordinate", 1);
      if (const std::string_view v = reader.word(); !v.empty()) {
        double value = 0;
        if (!parse_number(v, value) || !std::isfinite(static_cast<float>(value))) {
          reader.fail(fmt::format("a texture coordinate is '{}', not a finite number", excerpt(v)));
        }
      }
    } else if (key == "f") {
      for (std::string_view word = reader.word(); !word.empty(); word = reader.word()) {
        check_corner(word, reader);
      }
    } else if (key == "mtllib" && !alone) {
      materials.add_library(reader.rest());
    } else if (key == "usemtl") {
      if (const std::string_view name = reader.rest(); !name.empty()) out.names.emplace_back(name);
    }
  }
  return out;
}

/// A stream of bytes that stay where they are.
class ByteStream : public std::streambuf {
 public:
  explicit ByteStream(std::vector<std::byte>& bytes) {
    auto* begin = reinterpret_cast<char*>(bytes.data());
    setg(begin, begin, begin + bytes.size());
  }
};

struct CornerHash {
  std::size_t operator()(const std::array<std::int64_t, 3>& corner) const {
    std::uint64_t hash = 0;
    for (const std::int64_t index : corner) {
      hash = (hash ^ static_cast<std::uint64_t>(index)) * 0x9e3779b97f4a7c15ull;
      hash ^= hash >> 32;
    }
    return static_cast<std::size_t>(hash);
  }
};

/// What tinyobjloader calls back: collects the lines of the file in order.
class Collector {
 public:
  Collector(const std::filesystem::path& path,
            bool alone,
            std::span<const std::string> names,
            MtlMaterials& materials)
      : path_(path),
        names_(names),
        materials_(materials),
        builder_(path, alone ? kMostAlone : kMostTogether) {}

  static tinyobj::callback_t callbacks() {
    tinyobj::callback_t calls;
    calls.vertex_cb = [](void* self, float x, float y, float z, float) {
      static_cast<Collector*>(self)->positions_.push_back({x, y, z});
    };
    calls.normal_cb = [](void* self, float x, float y, float z) {
      static_cast<Collector*>(self)->normals_.push_back({x, y, z});
    };
    calls.texcoord_cb = [](void* self, float u, float v, float) {
      // The file's origin is the bottom left.
      static_cast<Collector*>(self)->uvs_.push_back({u, 1.0f - v});
    };
    calls.index_cb = [](void* self, tinyobj::index_t* corners, int count) {
      static_cast<Collector*>(self)->add_face(std::span(corners, static_cast<std::size_t>(count)));
    };
    calls.usemtl_cb = [](void* self, const char* name, int) {
      // Nameless lines may end in blanks.
      const bool is_named = std::string_view(name).find_first_not_of(' ') != std::string_view::npos;
      static_cast<Collector*>(self)->use_material(is_named);
    };
    return calls;
  }

  /// Faces may name vertices that follow them, so they are put together at the end.
  void finish(MeshFile& file) {
    std::vector<std::uint32_t> polygon;
    std::size_t first = 0;
    for (std::size_t face = 0; face < faces_.size(); ++face) {
      polygon.clear();
      for (std::size_t i = first; i < first + faces_[face].corners; ++i) {
        polygon.push_back(vertex(corners_[i], face));
      }
      first += faces_[face].corners;
      builder_.add_polygon(polygon, faces_[face].material);
    }
    file.bare = builder_.bare();
    file.mesh = builder_.finish();
  }

 private:
  /// Lines v, vt and vn counted from 0; -1 for none.
  using Corner = std::array<std::int64_t, 3>;
  struct Face {
    std::size_t corners;
    std::uint32_t material;
  };

  void use_material(bool is_named) {
    material_.clear();
    material_index_.reset();
    if (!is_named || names_.empty()) return;
    material_ = names_.front();
    names_ = names_.subspan(1);
  }

  void add_face(std::span<const tinyobj::index_t> corners) {
    if (corners.size() < 3) {
      throw DataError(fmt::format("{}: face {} has {} corners, fewer than three", path_.string(),
                                  faces_.size(), corners.size()));
    }
    for (const tinyobj::index_t& corner : corners) {
      if (corner.vertex_index == 0) {
        throw DataError(fmt::format("{}: face {} has a corner without a vertex (they count from 1)",
                                    path_.string(), faces_.size()));
      }
      corners_.push_back({absolute(corner.vertex_index, positions_.size()),
                          absolute(corner.texcoord_index, uvs_.size()),
                          absolute(corner.normal_index, normals_.size())});
    }
    if (!material_index_) material_index_ = materials_.index(material_);
    faces_.push_back({corners.size(), *material_index_});
  }

  /// From the file's index: it counts from 1, or back from the last line so far when negative, and
  /// is 0 for none.
  std::int64_t absolute(int index, std::size_t count) const {
    if (index >= 0) return index - std::int64_t{1};
    if (static_cast<std::size_t>(-std::int64_t{index}) > count) {
      throw DataError(fmt::format("{}: face {} has the index {}, but {} lines precede it",
                                  path_.string(), faces_.size(), index, count));
    }
    return static_cast<std::int64_t>(count) + index;
  }

  std::uint32_t vertex(const Corner& corner, std::size_t face) {
    const auto known = vertices_.find(corner);
    if (known != vertices_.end()) return known->second;
    const auto check = [&](const char* what, std::int64_t index, std::size_t count) {
      if (index < static_cast<std::int64_t>(count)) return;
      throw DataError(fmt::format("{}: face {} has the {} {}, but there are {}", path_.string(),
                                  face, what, index + 1, count));
    };
    check("vertex", corner[0], positions_.size());
    check("texture coordinate", corner[1], uvs_.size());
    check("normal", corner[2], normals_.size());
    std::optional<std::array<float, 2>> uv;
    std::optional<std::array<float, 3>> normal;
    if (corner[1] >= 0) uv = uvs_[static_cast<std::size_t>(corner[1])];
    if (corner[2] >= 0) normal = normals_[static_cast<std::size_t>(corner[2])];
    const std::uint32_t added =
        builder_.add_vertex(positions_[static_cast<std::size_t>(corner[0])], normal, uv);
    vertices_.emplace(corner, added);
    return added;
  }

  std::filesystem::path path_;
  std::span<const std::string> names_;  // that are still to come
  MtlMaterials& materials_;
  MeshBuilder builder_;
  std::vector<std::array<float, 3>> positions_;
  std::vector<std::array<float, 3>> normals_;
  std::vector<std::array<float, 2>> uvs_;
  std::vector<Corner> corners_;
  std::vector<Face> faces_;
  std::unordered_map<Corner, std::uint32_t, CornerHash> vertices_;
  std::string material_;
  std::optional<std::uint32_t> material_index_;
};

}  // namespace

MeshFile read_obj(MeshBytes source) {
  std::vector<std::byte>& bytes = source.bytes;
  const std::filesystem::path& path = source.path;
  normalize(bytes, path);
  MtlMaterials materials(path, source.seen);
  const Lines lines = check_lines(bytes, path, source.alone, materials);
  Collector collector(path, source.alone, lines.names, materials);
  ByteStream buffer(bytes);
  std::istream stream(&buffer);
  std::string warnings;
  std::string errors;
  if (!tinyobj::LoadObjWithCallback(stream, Collector::callbacks(), &collector, nullptr, &warnings,
                                    &errors) ||
      !errors.empty()) {
    throw DataError(fmt::format("{} is no valid OBJ file: {}", path.string(),
                                errors.substr(0, errors.find('\n'))));
  }
  MeshFile file;
  collector.finish(file);
  file.materials = std::move(materials.materials);
  const bool seen = std::any_of(
      file.materials.begin(), file.materials.end(),
      [&](const Material& material) { return !source.seen || source.seen(material.name); });
  if (lines.colors && seen) {
    spdlog::warn("{}: the colours of its vertices are left out: it has those of its materials",
                 path.string());
  }
  file.textures = std::move(materials.textures);
  return file;
}

}  // namespace raysplats::io
