// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/mesh.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <string>

#include "scene/mesh/mesh_edges.hpp"
#include "unit/text.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using test::contains;
using test::data_error;

namespace {

Mesh triangle() {
  Mesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  mesh.normals = {0, 0, 1, 0, 0, 1, 0, 0, 1};
  mesh.uvs = {0, 0, 1, 0, 0, 1};
  mesh.triangles = {0, 1, 2};
  mesh.materials = {0};
  return mesh;
}

/// The cube [-1, 1]^3, outward, with 8 shared corners and 12 triangles.
Mesh cube() {
  Mesh mesh;
  for (int i = 0; i < 8; ++i) {
    for (int c = 0; c < 3; ++c) mesh.positions.push_back((i >> c & 1) != 0 ? 1.0f : -1.0f);
  }
  mesh.triangles = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                    2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  mesh.materials.assign(12, 0);
  return mesh;
}

glm::dvec3 at(const std::vector<float>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

glm::dvec3 face_normal(const Mesh& mesh, std::size_t i) {
  const glm::dvec3 a = at(mesh.positions, mesh.triangles[3 * i]);
  return glm::normalize(glm::cross(at(mesh.positions, mesh.triangles[3 * i + 1]) - a,
                                   at(mesh.positions, mesh.triangles[3 * i + 2]) - a));
}

/// Every triangle with vertices of its own.
Mesh unwelded(const Mesh& mesh) {
  Mesh result;
  result.materials = mesh.materials;
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      result.positions.push_back(static_cast<float>(at(mesh.positions, mesh.triangles[i])[c]));
    }
    result.triangles.push_back(static_cast<std::uint32_t>(i));
  }
  return result;
}

}  // namespace

TEST_CASE("a mesh whose arrays do not fit is rejected with the first bad place") {
  CHECK_NOTHROW(validate(triangle(), 1, "m"));
  CHECK_NOTHROW(validate(Mesh{}, 0, "m"));
  const auto rejected = [](const std::function<void(Mesh&)>& spoil) {
    Mesh mesh = triangle();
    spoil(mesh);
    const std::string message = data_error([&] { validate(mesh, 1, "some.obj"); });
    CHECK(contains(message, "some.obj"));
    return message;
  };
  CHECK(contains(rejected([](Mesh& m) { m.positions[4] = std::nanf(""); }),
                 "position of vertex 1 is nan"));
  CHECK(contains(rejected([](Mesh& m) { m.positions[8] = std::numeric_limits<float>::infinity(); }),
                 "position of vertex 2 is inf"));
  CHECK(contains(rejected([](Mesh& m) { m.normals[3] = std::nanf(""); }), "normal of vertex 1"));
  CHECK(contains(rejected([](Mesh& m) { m.uvs[5] = std::nanf(""); }), "coordinate of vertex 2"));
  CHECK(contains(rejected([](Mesh& m) { m.triangles[2] = 3; }), "triangle 0 has the vertex 3"));
  CHECK(contains(rejected([](Mesh& m) { m.materials[0] = 1; }), "triangle 0 has the material 1"));
  CHECK(contains(rejected([](Mesh& m) { m.positions.pop_back(); }), "no whole number"));
  CHECK(contains(rejected([](Mesh& m) { m.triangles.pop_back(); }), "no whole number"));
  CHECK(contains(rejected([](Mesh& m) { m.normals.pop_back(); }), "8 normal coordinates where 9"));
  CHECK(contains(rejected([](Mesh& m) { m.uvs.pop_back(); }), "5 texture coordinates where 6"));
  CHECK(contains(rejected([](Mesh& m) { m.materials.clear(); }), "0 material indices where 1"));
}

TEST_CASE("a degenerate triangle is allowed") {
  Mesh mesh = triangle();
  mesh.triangles = {1, 1, 1};
  CHECK_NOTHROW(validate(mesh, 1, "m"));
  CHECK_NOTHROW(add_smooth_normals(mesh));
  CHECK_NOTHROW(validate(mesh, 1, "m"));
}

TEST_CASE("normals stay perpendicular to their triangle under any affine map") {
  CounterRng rng(11, 3);
  Mesh mesh = unwelded(cube());
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    for (int c = 0; c < 3; ++c) {
      mesh.normals.push_back(static_cast<float>(face_normal(mesh, i / 3)[c]));
    }
  }
  int mirrored = 0;
  for (int round = 0; round < 20; ++round) {
    glm::dmat4 matrix(1.0);
    for (int column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) matrix[column][row] = rng.normal();
    }
    mirrored += glm::determinant(glm::dmat3(matrix)) < 0.0 ? 1 : 0;
    const Mesh moved = transformed(mesh, matrix);
    const glm::dvec3 center = matrix[3];
    for (std::size_t i = 0; i < moved.triangle_count(); ++i) {
      const glm::dvec3 normal = face_normal(moved, i);
      const glm::dvec3 corner = at(moved.positions, moved.triangles[3 * i]);
      // The image of a cube around the origin is a parallelepiped around the translation.
      CHECK(glm::dot(normal, corner - center) > 0.0);
      for (std::size_t k = 0; k < 3; ++k) {
        CHECK(glm::dot(normal, at(moved.normals, moved.triangles[3 * i + k])) > 1.0 - 1e-4);
      }
    }
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
      const glm::dvec3 expected = matrix * glm::dvec4(at(mesh.positions, i), 1.0);
      CHECK(glm::distance(at(moved.positions, i), expected) < 1e-5);
    }
  }
  CHECK(mirrored > 3);
  CHECK(mirrored < 17);
}

TEST_CASE("a flattening map keeps normals finite, a projective or infinite one is rejected") {
  const Mesh flat = transformed(triangle(), glm::scale(glm::dmat4(1.0), {1.0, 1.0, 0.0}));
  CHECK(at(flat.normals, 0) == glm::dvec3(0, 0, 1));
  const Mesh line = transformed(triangle(), glm::scale(glm::dmat4(1.0), {1.0, 0.0, 0.0}));
  CHECK(at(line.normals, 0) == glm::dvec3(0, 0, 1));
  glm::dmat4 projective(1.0);
  projective[2][3] = -1.0;
  CHECK(contains(data_error([&] { transformed(triangle(), projective); }), "last row 0 0 0 1"));
  glm::dmat4 infinite(1.0);
  infinite[3][0] = std::numeric_limits<double>::infinity();
  CHECK(contains(data_error([&] { transformed(triangle(), infinite); }), "row 0"));
}

TEST_CASE("smooth normals of a cube point along its diagonals, however its faces are split") {
  // Each corner has faces of three directions with equal angles (a right one or two halves of it).
  for (Mesh mesh : {cube(), unwelded(cube())}) {
    const std::size_t vertices = mesh.vertex_count();
    add_smooth_normals(mesh);
    CHECK(mesh.vertex_count() == vertices);
    REQUIRE(mesh.normals.size() == mesh.positions.size());
    for (std::size_t i = 0; i < vertices; ++i) {
      const glm::dvec3 expected = at(mesh.positions, i) / std::sqrt(3.0);
      CHECK(glm::distance(at(mesh.normals, i), expected) < 1e-6);
    }
    validate(mesh, 1, "cube");
  }
}

TEST_CASE("edges sharper than the crease angle stay hard") {
  Mesh mesh = cube();
  mesh.uvs.assign(16, 0.25f);
  add_smooth_normals(mesh, 80.0);
  CHECK(mesh.vertex_count() == 24);
  CHECK(mesh.uvs.size() == 48);
  validate(mesh, 1, "cube");
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(glm::distance(at(mesh.normals, mesh.triangles[3 * i + k]), face_normal(mesh, i)) <
            1e-6);
    }
  }
  Mesh exact = cube();
  add_smooth_normals(exact, 90.0);
  CHECK(exact.vertex_count() == 8);
}

TEST_CASE("a crease that runs out splits only the vertices along it") {
  // Two triangles folded by 60 degrees along the edge from (0,0,0) to (0,1,0).
  Mesh mesh;
  const float c = 0.5f;
  const auto s = static_cast<float>(std::sqrt(0.75));
  mesh.positions = {0, 0, 0, 0, 1, 0, 1, 0, 0, -c, 0, s};
  mesh.triangles = {0, 2, 1, 0, 1, 3};
  mesh.materials = {0, 0};
  Mesh smooth = mesh;
  add_smooth_normals(smooth, 61.0);
  CHECK(smooth.vertex_count() == 4);
  // Both angles at vertex 0 are right ones, so its normal is the mean.
  const glm::dvec3 mean = glm::normalize(face_normal(mesh, 0) + face_normal(mesh, 1));
  CHECK(glm::distance(at(smooth.normals, 0), mean) < 1e-6);
  add_smooth_normals(mesh, 59.0);
  CHECK(mesh.vertex_count() == 6);
  CHECK(glm::distance(at(mesh.normals, mesh.triangles[4]), face_normal(mesh, 1)) < 1e-6);
}

TEST_CASE("smooth normals weigh triangles by their angles, checked one by one") {
  CounterRng rng(5, 1);
  // A closed fan around vertex 0 on a bumpy ring.
  Mesh mesh;
  mesh.positions = {0.1f, -0.2f, 1.5f};
  constexpr std::uint32_t kRing = 9;
  for (std::uint32_t i = 0; i < kRing; ++i) {
    const double angle = 2.0 * std::numbers::pi * (i + 0.6 * rng.uniform()) / kRing;
    for (const double v : {std::cos(angle), std::sin(angle), 0.4 * rng.normal()}) {
      mesh.positions.push_back(static_cast<float>(v));
    }
    mesh.triangles.insert(mesh.triangles.end(), {0, 1 + i, 1 + (i + 1) % kRing});
    mesh.materials.push_back(0);
  }
  std::map<std::uint32_t, glm::dvec3> expected;
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 p = at(mesh.positions, mesh.triangles[3 * i + k]);
      const glm::dvec3 u = at(mesh.positions, mesh.triangles[3 * i + (k + 1) % 3]) - p;
      const glm::dvec3 v = at(mesh.positions, mesh.triangles[3 * i + (k + 2) % 3]) - p;
      const double angle = std::acos(glm::dot(glm::normalize(u), glm::normalize(v)));
      expected.emplace(mesh.triangles[3 * i + k], glm::dvec3(0.0)).first->second +=
          angle * face_normal(mesh, i);
    }
  }
  add_smooth_normals(mesh);
  CHECK(mesh.vertex_count() == kRing + 1);
  for (const auto& [vertex, sum] : expected) {
    CHECK(glm::distance(at(mesh.normals, vertex), glm::normalize(sum)) < 1e-6);
  }
}

TEST_CASE("back-to-back triangles keep a normal each, unused vertices get any unit vector") {
  Mesh mesh;
  mesh.positions = {0, 0, 0, 1, 0, 0, -0.0f, 1, 0, 5, 5, 5};
  mesh.triangles = {0, 1, 2, 0, 2, 1};
  mesh.materials = {0, 0};
  add_smooth_normals(mesh);
  validate(mesh, 1, "two-sided");
  for (std::size_t i = 0; i < 2; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(at(mesh.normals, mesh.triangles[3 * i + k]) == face_normal(mesh, i));
    }
  }
  CHECK(glm::length(at(mesh.normals, 3)) == doctest::Approx(1.0));
}

TEST_CASE("edges are open where no other triangle has both ends at the same positions") {
  // A tetrahedron whose vertices are all apart, with -0 for one 0; the last face has a material.
  Mesh body;
  for (const int corner : {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3}) {
    body.triangles.push_back(static_cast<std::uint32_t>(body.vertex_count()));
    for (int c = 1; c <= 3; ++c) body.positions.push_back(corner == c ? 1.0f : 0.0f);
  }
  body.positions[0] = -0.0f;
  body.materials = {0, 0, 0, 4};
  using Open = std::map<std::uint32_t, std::size_t>;
  CHECK(open_edges(body).empty());
  Mesh open = body;
  open.triangles.resize(9);
  open.materials.resize(3);
  CHECK(open_edges(open) == Open{{0, 3}});
  Mesh lonely = body;
  lonely.triangles.erase(lonely.triangles.begin(), lonely.triangles.begin() + 9);
  lonely.materials = {4};
  CHECK(open_edges(lonely) == Open{{4, 3}});
  // Rounding, as at the seam of a sphere, opens nothing, wherever it is; a gap does.
  for (int k = 0; k < 400; ++k) {
    Mesh moved = body;
    for (float& position : moved.positions) position += 0.0037f * static_cast<float>(k);
    moved.positions[0] = std::nextafter(moved.positions[0], 9.0f);
    moved.positions[4] = std::nextafter(moved.positions[4], -9.0f);
    CAPTURE(k);
    CHECK(open_edges(moved).empty());
    moved.positions[0] += 1e-4f;
    CHECK(!open_edges(moved).empty());
  }
  // Far from the origin only the size of the mesh counts, and the last digit that is left there.
  for (const float offset : {1e3f, 5e5f}) {
    CAPTURE(offset);
    Mesh pane;
    for (const float corner : {0.0f, 0.4f, 0.0f, 0.4f}) {
      pane.positions.insert(pane.positions.end(),
                            {offset + corner, pane.positions.size() < 6 ? 0.0f : 0.4f, 0.0f});
    }
    pane.triangles = {0, 1, 2, 2, 1, 3};
    pane.materials = {0, 0};
    CHECK(open_edges(pane) == Open{{0, 4}});
    Mesh moved = body;
    for (std::size_t i = 0; i < moved.positions.size(); i += 3) moved.positions[i] += offset;
    moved.positions[0] = std::nextafter(moved.positions[0], 9e9f);
    CHECK(open_edges(moved).empty());
  }
  // A triangle without area opens nothing.
  body.triangles.insert(body.triangles.end(), {0, 0, 1});
  body.materials.push_back(7);
  CHECK(open_edges(body).empty());
}

TEST_CASE("normals without direction are replaced and the others normalized") {
  Mesh mesh = triangle();
  mesh.normals = {0, 3, 4, 0, 0, 0, 0, 0, 1};
  normalize_normals(mesh);
  CHECK(glm::distance(at(mesh.normals, 0), glm::dvec3(0, 0.6, 0.8)) < 1e-6);
  CHECK(at(mesh.normals, 1) == glm::dvec3(0, 0, 1));
  mesh.triangles = {0, 0, 0};
  mesh.normals.assign(9, 0.0f);
  normalize_normals(mesh);
  CHECK(glm::length(at(mesh.normals, 0)) == doctest::Approx(1.0));
}
