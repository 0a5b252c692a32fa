// SPDX-License-Identifier: Apache-2.0
#include "io/mesh/mesh_file.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "scene/mesh/mesh.hpp"
#include "skip_test.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("meshes are chosen by their extension, in any case") {
  const Scratch scratch;
  write_bytes(scratch / "m.OBJ", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK(io::read_mesh(scratch / "m.OBJ").mesh.triangle_count() == 1);
  for (const std::string name : {"m.stl", "m", "m.obj.bak"}) {
    CHECK(contains(data_error([&] { io::read_mesh(scratch / name); }), "unknown extension"));
  }
  for (const std::string name : {"a.obj", "a.ply", "a.gltf", "a.glb"}) {
    const std::string message = data_error([&] { io::read_mesh(scratch / name); });
    CHECK(contains(message, name));
    CHECK(contains(message, "does not exist"));
    fs::create_directories(scratch / name);
    CHECK(contains(data_error([&] { io::read_mesh(scratch / name); }), "is not a file"));
  }
}

TEST_CASE("textures have three channels") {
  Image image(2, 1, 4);
  image.data = {0.1f, 0.2f, 0.3f, 0.4f, 0.5f, 0.6f, 0.7f, 0.8f};
  CHECK(io::to_texture(image).data == std::vector<float>{0.1f, 0.2f, 0.3f, 0.5f, 0.6f, 0.7f});
  Image grey(1, 1, 2);
  grey.data = {0.3f, 0.9f};
  CHECK(io::to_texture(grey).data == std::vector<float>{0.3f, 0.3f, 0.3f});
}

TEST_CASE("meshes of the real collection have their published sizes") {
  const auto folder = test_data();
  SKIP_TEST_UNLESS(folder && fs::exists(*folder / "meshes"),
                   "RAYSPLATS_TEST_DATA is not set, or has no folder meshes");
  struct Expected {
    std::string name;
    std::size_t vertices;  ///< distinct corners of faces; all of the file in a PLY
    std::size_t triangles;
    std::array<float, 6> box;  ///< lowest and highest x, y and z
    bool textured;
  };
  const std::array<float, 6> bunny{-0.09469f, 0.061009f, 0.032987f, 0.187321f, -0.061874f, 0.0588f};
  const std::vector<Expected> meshes{
      {"stanford-bunny.obj", 34834, 69451, bunny, false},
      {"stanford-bunny.ply", 35947, 69451, bunny, false},
      {"armadillo.obj",
       49990,
       99976,
       {-0.682785f, 0.682785f, -0.813372f, 0.813372f, -0.620408f, 0.620408f},
       false},
      {"teapot.obj", 3644, 6320, {-3.0f, 3.434f, 0.0f, 3.15f, -2.0f, 2.0f}, false},
      {"suzanne.obj",
       507,
       968,
       {-3.86125f, -1.126875f, 0.267311f, 2.236061f, 3.25233f, 4.955455f},
       false},
      {"spot.obj",
       3225,
       5856,
       {-0.471552f, 0.471552f, -0.736784f, 0.953646f, -0.668909f, 1.049f},
       true},
  };
  for (const Expected& expected : meshes) {
    CAPTURE(expected.name);
    io::MeshFile file = io::read_mesh(*folder / "meshes" / expected.name);
    Mesh& mesh = file.mesh;
    CHECK(mesh.triangle_count() == expected.triangles);
    CHECK(mesh.uvs.empty() != expected.textured);
    CHECK(mesh.vertex_count() == expected.vertices);
    CHECK(file.materials.size() == 1);
    std::array<float, 6> box;
    for (std::size_t c = 0; c < 3; ++c) {
      box[2 * c] = std::numeric_limits<float>::infinity();
      box[2 * c + 1] = -box[2 * c];
      for (std::size_t i = c; i < mesh.positions.size(); i += 3) {
        box[2 * c] = std::min(box[2 * c], mesh.positions[i]);
        box[2 * c + 1] = std::max(box[2 * c + 1], mesh.positions[i]);
      }
      CHECK(box[2 * c] == doctest::Approx(expected.box[2 * c]).epsilon(1e-5));
      CHECK(box[2 * c + 1] == doctest::Approx(expected.box[2 * c + 1]).epsilon(1e-5));
    }
    const std::size_t before = mesh.vertex_count();
    add_smooth_normals(mesh);
    validate(mesh, file.materials.size(), expected.name);
    CHECK(mesh.vertex_count() >= before);
    double worst = 0.0;
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
      const double x = mesh.normals[3 * i];
      const double y = mesh.normals[3 * i + 1];
      const double z = mesh.normals[3 * i + 2];
      worst = std::max(worst, std::abs(std::sqrt(x * x + y * y + z * z) - 1.0));
    }
    CHECK(worst < 1e-5);
  }
}
