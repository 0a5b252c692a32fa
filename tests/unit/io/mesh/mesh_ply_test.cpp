// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "io/mesh/mesh_file.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

const std::string kVertices =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";

io::MeshFile read(const std::string& bytes) {
  const Scratch scratch;
  write_bytes(scratch / "m.ply", bytes);
  return io::read_mesh(scratch / "m.ply");
}

std::string error_of(const std::string& bytes) {
  const std::string message = data_error([&] { read(bytes); });
  CHECK(contains(message, "m.ply"));
  return message;
}

std::string ascii(const std::string& elements, const std::string& rows) {
  return "ply\nformat ascii 1.0\n" + kVertices + elements +
         "end_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + rows;
}

const std::string kFaces = "element face 2\nproperty list uchar int vertex_indices\n";

template <class T>
void put_ordered(std::string& bytes, T value, bool big) {
  std::string raw;
  put(raw, value);
  if (big) std::reverse(raw.begin(), raw.end());
  bytes += raw;
}

/// Faces with scalars and lists of other properties around the indices, behind another element.
std::string binary(bool big) {
  std::string bytes =
      std::string("ply\nformat binary_") + (big ? "big" : "little") + "_endian 1.0\n" + kVertices +
      "element edge 2\nproperty int a\nproperty list ushort double w\n"
      "element face 2\nproperty uchar flag\nproperty list ushort ushort vertex_index\n"
      "property list uchar float texcoord\nend_header\n";
  for (const float v : {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}) put_ordered(bytes, v, big);
  for (int edge = 0; edge < 2; ++edge) {
    put_ordered(bytes, std::int32_t{7}, big);
    put_ordered(bytes, static_cast<std::uint16_t>(edge), big);
    for (int i = 0; i < edge; ++i) put_ordered(bytes, 1.5, big);
  }
  for (const std::vector<std::uint16_t>& face :
       {std::vector<std::uint16_t>{0, 1, 2, 3}, std::vector<std::uint16_t>{3, 2, 0}}) {
    put_ordered(bytes, std::uint8_t{1}, big);
    put_ordered(bytes, static_cast<std::uint16_t>(face.size()), big);
    for (const std::uint16_t index : face) put_ordered(bytes, index, big);
    put_ordered(bytes, std::uint8_t{1}, big);
    put_ordered(bytes, 0.5f, big);
  }
  return bytes;
}

}  // namespace

TEST_CASE("PLY meshes: ASCII with triangles and a quad") {
  const io::MeshFile file = read(ascii(kFaces, "3 0 1 2\n4 0 1 2 3\n"));
  CHECK(file.mesh.vertex_count() == 4);
  CHECK(file.mesh.triangle_count() == 3);
  CHECK(std::vector<std::uint32_t>(file.mesh.triangles.begin(), file.mesh.triangles.begin() + 3) ==
        std::vector<std::uint32_t>{0, 1, 2});
  CHECK(file.mesh.normals.empty());
  CHECK(file.mesh.uvs.empty());
  REQUIRE(file.materials.size() == 1);
  CHECK(file.materials[0].name == "default");
}

TEST_CASE("PLY meshes: binary of both byte orders, other elements and properties skipped") {
  for (const bool big : {false, true}) {
    const io::MeshFile file = read(binary(big));
    CHECK(file.mesh.positions == std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
    REQUIRE(file.mesh.triangle_count() == 3);
    CHECK(file.mesh.triangles[6] == 3);
    CHECK(file.mesh.triangles[8] == 0);
  }
  const std::string whole = binary(false);
  for (std::size_t cut = 1; cut < 60; ++cut) {
    CHECK(contains(error_of(whole.substr(0, whole.size() - cut)), "truncated"));
  }
}

TEST_CASE("PLY meshes: normals and texture coordinates") {
  const io::MeshFile file = read(
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty "
      "float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty float s\n"
      "property float t\nelement face 1\nproperty list uchar int vertex_index\nend_header\n"
      "0 0 0 0 0 2 0 0\n1 0 0 0 0 0 1 0.25\n0 1 0 0 1 0 0 1\n3 0 1 2\n");
  CHECK(file.mesh.normals == std::vector<float>{0, 0, 1, 0, 0, 1, 0, 1, 0});
  CHECK(file.mesh.uvs == std::vector<float>{0, 1, 1, 0.75f, 0, 0});
}

TEST_CASE("PLY meshes: colours and textures are left out with a warning") {
  const auto read_colored = [](const std::string& comment, const std::string& color,
                               const std::string& of_faces, const std::string& face) {
    read("ply\nformat ascii 1.0\n" + comment +
         "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n" + color +
         "element face 1\nproperty list uchar int vertex_indices\n" + of_faces + "end_header\n" +
         (color.empty() ? "0 0 0\n1 0 0\n0 1 0\n" : "0 0 0 9\n1 0 0 9\n0 1 0 9\n") + "3 0 1 2" +
         face + "\n");
  };
  const auto lines = [&](const auto&... parts) {
    const LogCapture log;
    read_colored(parts...);
    CHECK(log.contains("m.ply") == (log.lines() > 0));
    return log.lines();
  };
  CHECK(lines("comment made by hand\n", "", "", "") == 0);
  CHECK(lines("", "property uchar red\n", "", "") == 1);
  CHECK(lines("", "", "property uchar red\n", " 9") == 1);
  CHECK(lines("", "", "property list uchar float texcoord\n", " 6 0 0 1 0 0 1") == 1);
  CHECK(lines("comment TextureFile a b.png\n", "", "", "") == 1);
  const LogCapture log;
  read_colored("comment TextureFile a b.png\n", "", "", "");
  CHECK(log.contains("texture a b.png is left out"));
}

TEST_CASE("PLY meshes: what is malformed is named") {
  CHECK(contains(error_of(ascii("", "")), "no faces"));
  CHECK(contains(error_of(ascii("element face 1\nproperty list uchar int other\n", "3 0 1 2\n")),
                 "no faces"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n3 0 1 4\n")), "face 1 has the vertex 4"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n3 0 1 -1\n")), "face 1 has the vertex -1"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n3 0 1 1.5\n")), "face 1 has the vertex 1.5"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n3 0 1 nan\n")), "face 1 has the vertex"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n2 0 1\n")), "2 corners"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n-3 0 1 2\n")), "length of a list is -3"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\nnan 0 1 2\n")), "length of a list"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n1e18 0 1 2\n")), "missing in line"));
  CHECK(contains(error_of(ascii(kFaces, "3 0 1 2\n")), "truncated"));
  CHECK(contains(error_of(ascii("element face 1\nproperty list uchar what vertex_indices\n", "")),
                 "unknown type"));
  CHECK(contains(
      error_of("ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n"),
      "holds no mesh"));
  CHECK(contains(error_of(ascii("element face 0\nproperty list uchar int vertex_indices\n", "")),
                 "no triangles"));
  std::string spoilt = ascii(kFaces, "3 0 1 2\n3 0 1 3\n");
  spoilt.replace(spoilt.find("\n1 1 0"), 6, "\n1 nan 0");
  CHECK(contains(error_of(spoilt), "position of vertex 2 is nan"));
}

TEST_CASE("PLY meshes: counts that no file can hold end at once") {
  const std::string huge = "element none 18446744073709551615\n";
  CHECK(read(ascii(huge + kFaces, "3 0 1 2\n3 0 1 3\n")).mesh.triangle_count() == 2);
  CHECK(contains(error_of(ascii("element face 18446744073709551615\nproperty list uchar int "
                                "vertex_indices\n",
                                "3 0 1 2\n")),
                 "truncated"));
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\n" + kVertices +
      "element face 4000000000\nproperty list uint int vertex_indices\nend_header\n";
  bytes += std::string(48, '\0');
  put(bytes, std::uint32_t{4000000000u});
  put(bytes, std::int32_t{1});
  CHECK(contains(error_of(bytes), "truncated"));
}
