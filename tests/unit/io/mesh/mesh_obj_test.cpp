// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <string>
#include <vector>

#include "io/mesh/mesh_file.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;
using Kind = Material::Kind;

namespace {

io::MeshFile read(const std::string& obj, const std::string& mtl = "") {
  const Scratch scratch;
  write_bytes(scratch / "m.obj", obj);
  if (!mtl.empty()) write_bytes(scratch / "m.mtl", mtl);
  return io::read_mesh(scratch / "m.obj");
}

std::string error_of(const std::string& obj, const std::string& mtl = "") {
  const std::string message = data_error([&] { read(obj, mtl); });
  CHECK(contains(message, "m.obj"));
  CHECK(!contains(message, "\n"));
  return message;
}

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

Material mapped(const std::string& mtl) {
  const io::MeshFile file =
      read("mtllib m.mtl\n" + kSquare + "usemtl a\nf 1 2 3\n", "newmtl a\n" + mtl);
  REQUIRE(file.materials.size() == 1);
  CHECK(file.materials[0].name == "a");
  return file.materials[0];
}

}  // namespace

TEST_CASE("OBJ: triangles, quads and polygons with all forms of corners") {
  const io::MeshFile file =
      read("# a comment that ends in a backslash \\\n" + kSquare +
           "v 2.5e-1 -1 +0.5\nvt 0.25 0.75\nvt 1 0 0\nvn 0 0 2\n"
           "o thing\ng part\ns 1\n"
           "f 1 2 3\nf 1/1 2/2 4/1\nf 1//1 2//1 3//1\nf 1/1/1 2/2/1 3/1/1 4/2/1\nf 1 5 2 3 4\n");
  const Mesh& mesh = file.mesh;
  CHECK(mesh.triangle_count() == 1 + 1 + 1 + 2 + 3);
  CHECK(mesh.normals.size() == mesh.positions.size());
  CHECK(mesh.uvs.size() == 2 * mesh.vertex_count());
  CHECK(mesh.positions[0] == 0.0f);
  // The corner 1/1 of face 1 (the fourth to be made): v counts from the top of the image.
  const std::size_t corner = mesh.triangles[3];
  CHECK(mesh.uvs[2 * corner] == 0.25f);
  CHECK(mesh.uvs[2 * corner + 1] == doctest::Approx(0.25));
  // The normal of the file is made a unit vector.
  CHECK(mesh.normals[3 * std::size_t{mesh.triangles[6]} + 2] == 1.0f);
  REQUIRE(file.materials.size() == 1);
  CHECK(file.materials[0].name == "default");
  CHECK(file.materials[0].kind == Kind::kDiffuse);
}

TEST_CASE("OBJ: negative indices count back, positive ones may run ahead") {
  const io::MeshFile back = read("v 9 9 9\n" + kSquare + "f -4 -3 -2\nv 7 7 7\nf -1 -2 -3\n");
  CHECK(back.mesh.positions == std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0, 7, 7, 7, 0, 1, 0});
  CHECK(back.mesh.triangles == std::vector<std::uint32_t>{0, 1, 2, 3, 4, 2});
  const io::MeshFile ahead = read("f 1 2 3\n" + kSquare);
  CHECK(ahead.mesh.triangles == std::vector<std::uint32_t>{0, 1, 2});
}

TEST_CASE("OBJ: corners are shared unless their normals or texture coordinates differ") {
  const io::MeshFile shared = read(kSquare + "f 1 2 3 4\nf 4 3 2 1\n");
  CHECK(shared.mesh.vertex_count() == 4);
  CHECK(shared.mesh.normals.empty());
  CHECK(shared.mesh.uvs.empty());
  const io::MeshFile seam = read(kSquare + "vt 0 0\nvt 1 1\nf 1/1 2/1 3/1\nf 1/2 3/1 4/1\n");
  CHECK(seam.mesh.vertex_count() == 5);
}

TEST_CASE("OBJ: faces without normals among others that have them are flat") {
  const io::MeshFile file =
      read(kSquare + "v 0 0 1\nvn 1 0 0\nf 1//1 2//1 3//1\nf 1 2 3\nf 1 2 5\n");
  const Mesh& mesh = file.mesh;
  REQUIRE(mesh.triangle_count() == 3);
  const std::vector<std::vector<float>> expected{{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};
  for (std::size_t i = 0; i < 9; ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(mesh.normals[3 * std::size_t{mesh.triangles[i]} + c] == expected[i / 3][c]);
    }
  }
}

TEST_CASE("OBJ: line ends, tabs and continued lines of every kind") {
  const Mesh expected = read(kSquare + "f 1 2 3 4\n").mesh;
  for (const std::string text :
       {"v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 3 4\r\n",
        "v 0 0 0\rv 1 0 0\rv 1 1 0\rv 0 1 0\rf 1 2 3 4",
        "v\t0\t0\t0\nv 1\f0\v0\nv 1 1 0  \n  v 0 1 0\nf 1 2 3 4   ",
        "v 0 0 0 1\nv 1 \\\n0 0\nv 1 1 0 0.5 0.5 0.5\nv 0 1 0\nf 1 2 \\\r\n3 4\nunknown line\n"}) {
    const Mesh mesh = read(text).mesh;
    CHECK(mesh.positions == expected.positions);
    CHECK(mesh.triangles == expected.triangles);
  }
}

TEST_CASE("OBJ: a byte order mark hides neither the first vertex nor the first material") {
  const io::MeshFile file = read(
      "\xEF\xBB\xBFv 0 0 0\nv 1 0 0\nv 1 1 0\nmtllib m.mtl\n"
      "usemtl a\nf 1 2 3\n",
      "\xEF\xBB\xBFnewmtl a\nKd 1 0 0\n");
  CHECK(file.mesh.positions == std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0});
  REQUIRE(file.materials.size() == 1);
  CHECK(file.materials[0].color == Rgb{1, 0, 0});
}

TEST_CASE("OBJ: corners that end in slashes have no more than what stands before these") {
  // Other texture coordinates and normals than those of the corners' own numbers.
  const std::string lines =
      kSquare + "vt 0.5 1\nvt 0 0\nvt 1 0\nvt 0 0\nvn 0 0 1\nvn 1 0 0\nvn 1 0 0\n";
  for (const std::string face :
       {"f 1/ 2/ 3/\n", "f 1// 2// 3//\n", "f 1/ 2// 3/", "f 1//\t2/ 3//\r\n"}) {
    CAPTURE(face);
    const Mesh mesh = read(lines + face).mesh;
    CHECK(mesh.triangles == std::vector<std::uint32_t>{0, 1, 2});
    CHECK(mesh.positions == std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, 0});
    CHECK(mesh.uvs.empty());
    CHECK(mesh.normals.empty());
  }
  const Mesh mesh = read(lines + "f 1/1/ 2/1/ 3/1/\n").mesh;
  CHECK(mesh.uvs == std::vector<float>{0.5f, 0, 0.5f, 0, 0.5f, 0});
  CHECK(mesh.normals.empty());
}

TEST_CASE("OBJ: comments may follow numbers, and are no part of a continued line") {
  const Mesh expected = read(kSquare + "vt 0.5 1\nf 1/1 2/1 3/1\n").mesh;
  const Mesh mesh = read(
                        "# begin \\\nv 0 0 0 # first \\\nv 1 0 0# 2\nv 1 1 0 #\nv 0 1 0\n"
                        "vt 0.5 1 # 7\nf 1/1 2/1 3/1 # 4 5\n# end")
                        .mesh;
  CHECK(mesh.positions == expected.positions);
  CHECK(mesh.triangles == expected.triangles);
  CHECK(mesh.uvs == expected.uvs);
  CHECK(read(kSquare + "vt 0.5 # 7\nf 1/1 2/1 3/1#").mesh.uvs.size() == 6);
  const io::MeshFile named =
      read("mtllib m.mtl\n" + kSquare + "usemtl a#1\nf 1 2 3\n", "newmtl a#1\nKd 1 0 0\n");
  CHECK(named.materials.at(0).name == "a#1");
}

TEST_CASE("OBJ: colours of vertices are left out with one warning") {
  const std::string faces = "usemtl a\nf 1 2 3\n";
  const LogCapture log;
  read("v 0 0 0\nv 1 0 0 1\nv 0 1 0 1 # 0 0\n" + faces);
  CHECK(log.lines() == 0);
  const std::string colored = "v 0 0 0\nv 1 0 0 1 0 0\nv 0 1 0 0 1 0\n" + faces;
  CHECK(read(colored).mesh.positions == std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0});
  CHECK(log.lines() == 1);
  CHECK(log.contains("m.obj: the colours of its vertices are left out"));
  // Nobody would see them where all materials are replaced.
  const Scratch scratch;
  write_bytes(scratch / "m.obj", colored);
  io::read_mesh(scratch / "m.obj", [](const std::string& name) { return name != "a"; });
  CHECK(log.lines() == 1);
}

TEST_CASE("OBJ: what is malformed is named") {
  CHECK(contains(error_of("v 0 0 0\nv 0 nan 0\nv 1 0 0\nf 1 2 3\n"), "not finite in line 2"));
  CHECK(contains(error_of("v 0 0 0\nv 0 1 inf\nv 1 0 0\nf 1 2 3\n"), "line 2"));
  CHECK(contains(error_of("v 0 0 0\nv 0 1 1e39\nv 1 0 0\nf 1 2 3\n"), "line 2"));
  CHECK(contains(error_of("v 0 0\n"), "missing in line 1"));
  CHECK(contains(error_of("v 0 0 0x1\n"), "'0x1'"));
  CHECK(contains(error_of(kSquare + "vn 1 0\n"), "line 5"));
  CHECK(contains(error_of(kSquare + "vt a 0\n"), "line 5"));
  CHECK(contains(error_of(kSquare + "vt 0 nan\n"), "line 5"));
  CHECK(contains(error_of(kSquare + "f 1 2 5\n"), "face 0 has the vertex 5, but there are 4"));
  CHECK(contains(error_of(kSquare + "f 1 2 3\nf 1/1 2/1 3/1\n"), "face 1 has the texture"));
  CHECK(contains(error_of(kSquare + "f 1//9 2//9 3//9\n"), "the normal 9"));
  CHECK(contains(error_of(kSquare + "f 1 2 -5\n"), "index -5, but 4 lines precede it"));
  CHECK(contains(error_of(kSquare + "f 0 1 2\n"), "without a vertex"));
  CHECK(contains(error_of(kSquare + "f a b c\n"), "'a'"));
  for (const std::string corner : {"4294967299", "-4294967299", "1/4294967297", "1//x", "1/2/3/4",
                                   "1.5", "/1", "/", "1///1"}) {
    CAPTURE(corner);
    CHECK(contains(error_of(kSquare + "f 1 2 " + corner + "\n"),
                   "a corner is '" + corner + "', not whole numbers such as 1/2/3 in line 5"));
  }
  CHECK(error_of(kSquare + "f 1 2 " + std::string(10000, 'x') + "\n").size() < 400);
  CHECK(contains(error_of(kSquare + "f 1 2\n"), "2 corners"));
  CHECK(contains(error_of(kSquare), "no triangles"));
  CHECK(contains(error_of(""), "no triangles"));
  CHECK(contains(error_of(std::string("v 0 0 0\n\0", 9)), "zero byte at byte 8"));
  std::string many = kSquare + "f";
  for (int i = 0; i < 5000; ++i) many += " 1";
  CHECK(contains(error_of(many), "5000 corners"));
}

TEST_CASE("OBJ: MTL materials map row by row") {
  const Material plain = mapped("Kd 0.1 0.2 0.3\nKs 0.2 0.4 0.6\nNs 30\nd 1\nillum 2\n");
  CHECK(plain.kind == Kind::kDiffuse);
  CHECK(plain.color == Rgb{0.1f, 0.2f, 0.3f});
  CHECK(plain.specular == doctest::Approx(0.4));
  // k = 2 / roughness^4 - 2 gives the exponent of the file back.
  CHECK(2.0 / std::pow(plain.roughness, 4.0) - 2.0 == doctest::Approx(30.0));
  CHECK(plain.emission == Rgb{0, 0, 0});
  CHECK(mapped("Kd 0.5 0.5 0.5\nKs 1 1 1\nNs 30\nillum 1\n").specular == 0.0f);

  for (const std::string illum : {"3", "5"}) {
    const Material mirror = mapped("Kd 0.1 0.1 0.1\nKs 0.9 0.8 0.7\nillum " + illum + "\n");
    CHECK(mirror.kind == Kind::kMirror);
    CHECK(mirror.color == Rgb{0.9f, 0.8f, 0.7f});
    CHECK(mirror.roughness == 0.0f);
  }
  CHECK(mapped("Kd 0.5 0.6 0.7\nKs 0 0 0\nillum 3\n").color == Rgb{0.5f, 0.6f, 0.7f});

  for (const std::string illum : {"4", "6", "7", "9"}) {
    const Material glass = mapped("Kd 0.1 0.1 0.1\nNi 1.33\nillum " + illum + "\n");
    CHECK(glass.kind == Kind::kGlass);
    CHECK(glass.ior == 1.33f);
    CHECK(glass.color == Rgb{1, 1, 1});
  }
  CHECK(mapped("Kd 1 1 1\nNi 1.5\nd 0.3\nillum 2\n").kind == Kind::kGlass);
  const Material filter = mapped("Kd 1 1 1\nNi 1.5\nTf 0.9 1 0.9\nillum 2\n");
  CHECK(filter.kind == Kind::kGlass);
  CHECK(filter.color == Rgb{0.9f, 1.0f, 0.9f});
  // What exporters write for opaque materials.
  CHECK(mapped("Kd 1 1 1\nNi 1.5\nd 1\nTr 0\nTf 1 1 1\nillum 2\n").kind == Kind::kDiffuse);

  const Material clear = mapped("Kd 0.1 0.2 0.3\nd 0.25\n");
  CHECK(clear.kind == Kind::kTransparent);
  CHECK(clear.opacity == 0.25f);
  CHECK(mapped("Kd 1 1 1\nTr 0.75\n").opacity == 0.25f);

  const Material lamp = mapped("Kd 0 0 0\nKe 2 3 4\n");
  CHECK(lamp.kind == Kind::kEmissive);
  CHECK(lamp.emission == Rgb{2, 3, 4});
  const Material glow = mapped("Kd 0.5 0 0\nKe 1 0 0\n");
  CHECK(glow.kind == Kind::kDiffuse);
  CHECK(glow.emission == Rgb{1, 0, 0});
}

TEST_CASE("OBJ: a material without Kd shows its texture as it is, whatever comes before it") {
  const Scratch scratch;
  write_image(scratch / "t.png", Image(2, 2, 3, 0.5f));
  write_bytes(scratch / "m.obj", "mtllib m.mtl\n" + kSquare + "vt 0 0\nusemtl a\nf 1/1 2/1 3/1\n");
  const auto color = [&](const std::string& mtl) {
    write_bytes(scratch / "m.mtl", mtl);
    return io::read_mesh(scratch / "m.obj").materials.at(0).color;
  };
  for (const std::string mtl :
       {"newmtl a\nKd 1 1 1\nmap_Kd t.png\n", "newmtl a\nmap_Kd t.png\n",
        "newmtl a\n\tmap_Kd t.png\n\tKd\t1 1 1\n", "newmtl z\nKd 0 0 1\nnewmtl a\nmap_Kd t.png\n",
        "newmtl a\nmap_Kd t.png\nnewmtl z\nKd 0 0 1\n"}) {
    CAPTURE(mtl);
    CHECK(color(mtl) == Rgb{1, 1, 1});
  }
  CHECK(color("newmtl z\nKd 0 0 1\nnewmtl a\nNs 3\n") == Material{}.color);
  CHECK(color("newmtl a\nKd 0 0 0\nmap_Kd t.png\n") == Rgb{0, 0, 0});
  CHECK(mapped("Ke 2 3 4\n").kind == Kind::kEmissive);
}

TEST_CASE("OBJ: a single number of an MTL is a grey, and -halo is no opacity") {
  CHECK(mapped("Kd 0.5\n").color == Rgb{0.5f, 0.5f, 0.5f});
  CHECK(mapped("\tKd\t0.25 # dark\r\n").color == Rgb{0.25f, 0.25f, 0.25f});
  CHECK(mapped("Kd 0 0 0\nKe 3\n").emission == Rgb{3, 3, 3});
  CHECK(mapped("Ks 0.6\nNs 3\n").specular == doctest::Approx(0.6));
  CHECK(mapped("Kd 0.5 0 1\nd -halo 0.25\n").opacity == 0.25f);
  CHECK(mapped("Kd 0.5 0 1\nd 0.25\n").opacity == 0.25f);
}

TEST_CASE("OBJ: a comment behind a texture is no part of its name, unless a file has it") {
  const Scratch scratch;
  write_image(scratch / "t.png", Image(3, 2, 3, 0.5f));
  write_bytes(scratch / "m.obj", "mtllib m.mtl\n" + kSquare + "usemtl a\nf 1 2 3\n");
  write_bytes(scratch / "m.mtl", "newmtl a\nmap_Kd t.png\t# of the front\n");
  CHECK(io::read_mesh(scratch / "m.obj").textures.at(0).width == 3);
  write_image(scratch / "t #1.png", Image(5, 2, 3, 0.5f));
  write_bytes(scratch / "m.mtl", "newmtl a\nmap_Kd t #1.png\n");
  CHECK(io::read_mesh(scratch / "m.obj").textures.at(0).width == 5);
}

TEST_CASE("OBJ: mtllib without a name, or of a folder, leaves the default material") {
  const Scratch scratch;
  fs::create_directories(scratch / "maps");
  const auto read_with = [&](const std::string& line) {
    write_bytes(scratch / "m.obj", line + "\n" + kSquare + "usemtl a\nf 1 2 3\n");
    return io::read_mesh(scratch / "m.obj").materials.at(0).color;
  };
  const LogCapture log;
  CHECK(read_with("mtllib") == Material{}.color);
  CHECK(read_with("mtllib   ") == Material{}.color);
  CHECK(log.lines() == 0);
  for (const std::string line : {"mtllib maps", "mtllib .", "mtllib maps/"}) {
    CHECK(read_with(line) == Material{}.color);
    CHECK(log.contains("m.obj: there is no material file "));
  }
  CHECK(log.lines() == 3);
}

TEST_CASE("OBJ: the first map_d of an MTL that is used is left out with a warning") {
  const std::string mtl = "newmtl a\nmap_d leaf.png\nnewmtl b\nmap_d -clamp on leaf.png\n";
  const LogCapture log;
  read("mtllib m.mtl\n" + kSquare + "usemtl c\nf 1 2 3\n", mtl + "newmtl c\n");
  CHECK(log.lines() == 0);
  read("mtllib m.mtl\n" + kSquare + "usemtl b\nf 1 2 3\nusemtl a\nf 1 2 3\n", mtl);
  CHECK(log.lines() == 1);
  CHECK(log.contains("m.obj: map_d of the material 'b' is left out"));
}

TEST_CASE("OBJ: hostile numbers of an MTL stay in range") {
  const Material material =
      mapped("Kd 1e30 -5 nan\nKs 9 9 9\nNs -1e30\nd 7\nNi -3\nKe 1e300 -1 0\nillum 99999999999\n");
  for (const float value : material.color) CHECK((value >= 0.0f && value <= 1.0f));
  for (const float value : material.emission) CHECK((value >= 0.0f && std::isfinite(value)));
  CHECK((material.roughness >= 0.0f && material.roughness <= 1.0f));
  CHECK(material.ior > 0.0f);
  CHECK(material.opacity == 1.0f);
}

TEST_CASE("OBJ: materials by use, missing ones become the default") {
  const std::string mtl =
      "newmtl red\nKd 1 0 0\nnewmtl not used\nmap_Kd none.png\nnewmtl my green\nKd 0 1 0\n"
      "newmtl my blue\nKd 0 0 1\n";
  const io::MeshFile file = read("mtllib m.mtl\n" + kSquare +
                                     "f 1 2 3\nusemtl my blue \nf 1 2 3\nusemtl red\nf 1 2 3\n"
                                     "usemtl gone\nf 1 2 3\nusemtl my blue\nf 1 2 4\n",
                                 mtl);
  REQUIRE(file.materials.size() == 4);
  CHECK(file.mesh.materials == std::vector<std::uint32_t>{0, 1, 2, 3, 1});
  CHECK(file.materials[0].name == "default");
  CHECK(file.materials[1].color == Rgb{0, 0, 1});
  CHECK(file.materials[2].color == Rgb{1, 0, 0});
  CHECK(file.materials[3].name == "gone");
  CHECK(file.materials[3].color == Material{}.color);
  CHECK(file.textures.empty());

  // A line without a name means the default.
  const io::MeshFile nameless = read(
      "mtllib m.mtl\n" + kSquare + "usemtl \r\nf 1 2 3\nusemtl  \nf 1 2 3\nusemtl red\nf 1 2 4\n",
      mtl);
  CHECK(nameless.mesh.materials == std::vector<std::uint32_t>{0, 0, 1});
  CHECK(nameless.materials.at(1).color == Rgb{1, 0, 0});

  const io::MeshFile lonely = read("mtllib absent.mtl\n" + kSquare + "usemtl x\nf 1 2 3\n");
  REQUIRE(lonely.materials.size() == 1);
  CHECK(lonely.materials[0].name == "x");
  CHECK(lonely.materials[0].kind == Kind::kDiffuse);
}

TEST_CASE("OBJ: textures are found beside the MTL, read once, and named when missing") {
  const Scratch scratch;
  Image grey(2, 1, 1);
  grey.data = {0.2f, 1.0f};
  fs::create_directories(scratch / "my files/maps");
  write_image(scratch / "my files/maps/a b.png", grey);
  write_bytes(
      scratch / "my files/m m.mtl",
      "newmtl a\nKd 1 1 1\nmap_Kd -clamp on maps\\a b.png\nnewmtl b\nmap_Kd maps/a b.png\n");
  write_bytes(scratch / "m.obj",
              "mtllib my files/m m.mtl\n" + kSquare + "usemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n");
  const io::MeshFile file = io::read_mesh(scratch / "m.obj");
  REQUIRE(file.textures.size() == 1);
  CHECK(file.textures[0].channels == 3);
  CHECK(file.textures[0].at(0, 0, 2) == doctest::Approx(0.2));
  REQUIRE(file.materials.size() == 2);
  CHECK(file.materials[0].texture == 0);
  CHECK(file.materials[1].texture == 0);

  write_bytes(scratch / "my files/m m.mtl", "newmtl a\nmap_Kd gone.png\n");
  const std::string message = data_error([&] { io::read_mesh(scratch / "m.obj"); });
  CHECK(contains(message, "material 'a'"));
  CHECK(contains(message, "gone.png"));
  CHECK(contains(message, "does not exist"));
}
