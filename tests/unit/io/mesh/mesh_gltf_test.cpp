// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "io/mesh/mesh_file.hpp"
#include "raysplats/io.hpp"
#include "unit/io/gltf_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;
using nlohmann::json;
using Indices = std::vector<std::uint32_t>;
using Floats = std::vector<float>;

namespace {

const Floats kSquare{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};

void check_close(const Floats& values, const Floats& expected) {
  REQUIRE(values.size() == expected.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    CHECK(values[i] == doctest::Approx(expected[i]).epsilon(1e-5));
  }
}

}  // namespace

TEST_CASE("glTF: an indexed mesh from a GLB, embedded, and external buffers") {
  GltfFile file = GltfFile::square();
  const auto check = [](const io::MeshFile& read) {
    CHECK(read.mesh.positions == kSquare);
    CHECK(read.mesh.triangles == Indices{0, 1, 2, 2, 1, 3});
    CHECK(read.mesh.normals.empty());
    CHECK(read.mesh.uvs.empty());
    REQUIRE(read.materials.size() == 1);
    CHECK(read.materials[0].name == "default");
  };
  check(read_gltf_mesh(file.glb()));
  check(read_gltf_mesh(file.gltf("data:application/octet-stream;base64," + base64(file.buffer)),
                       "m.gltf"));
  const Scratch scratch;
  write_bytes(scratch / "sub/m.gltf", file.gltf("some%20data.bin"));
  write_bytes(scratch / "sub/some data.bin", file.buffer);
  check(io::read_mesh(scratch / "sub/m.gltf"));
  fs::remove(scratch / "sub/some data.bin");
  CHECK(contains(data_error([&] { io::read_mesh(scratch / "sub/m.gltf"); }), "some data.bin"));
}

TEST_CASE("glTF: strips, fans and triangles, indexed or not") {
  const auto triangles = [](int mode, const std::vector<std::uint16_t>& indices) {
    GltfFile file;
    const int positions = file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0});
    const int accessor = indices.empty() ? -1 : file.add_indices(indices);
    json& primitive = file.add_mesh(positions);
    primitive["mode"] = mode;
    if (accessor >= 0) primitive["indices"] = accessor;
    return read_gltf_mesh(file.glb()).mesh.triangles;
  };
  CHECK(triangles(4, {}) == Indices{0, 1, 2, 3, 4, 5});
  CHECK(triangles(5, {}) == Indices{0, 1, 2, 1, 3, 2, 2, 3, 4, 3, 5, 4});
  CHECK(triangles(6, {}) == Indices{0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 5});
  CHECK(triangles(5, {5, 4, 3, 2}) == Indices{5, 4, 3, 4, 2, 3});
  CHECK(triangles(6, {5, 4, 3, 2}) == Indices{5, 4, 3, 5, 3, 2});
}

TEST_CASE("glTF: index types, strides and normalized texture coordinates") {
  GltfFile file;
  std::string interleaved;
  for (int i = 0; i < 3; ++i) {
    for (int c = 0; c < 3; ++c) put(interleaved, i == c + 1 ? 1.0f : 0.0f);
    for (const std::uint16_t v : {i == 1 ? 65535 : 0, 13107}) put(interleaved, v);
  }
  const int view = file.add_view(interleaved);
  file.json["bufferViews"][0]["byteStride"] = 16;
  file.json["accessors"].push_back(
      {{"bufferView", view}, {"componentType", 5126}, {"count", 3}, {"type", "VEC3"}});
  file.json["accessors"].push_back({{"bufferView", view},
                                    {"byteOffset", 12},
                                    {"componentType", 5123},
                                    {"normalized", true},
                                    {"count", 3},
                                    {"type", "VEC2"}});
  const int wide = file.add_accessor(Indices{2, 1, 0}, "SCALAR", 5125);
  const int narrow = file.add_accessor(std::vector<std::uint8_t>{0, 1, 2}, "SCALAR", 5121);
  const json attributes{{"POSITION", 0}, {"TEXCOORD_0", 1}};
  file.json["materials"].push_back(
      {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  const Scratch scratch;
  Image pixel(1, 1, 3, 0.5f);
  write_image(scratch / "p.png", pixel);
  file.json["images"].push_back({{"uri", "p.png"}});
  file.json["textures"].push_back({{"source", 0}});
  file.json["meshes"].push_back(
      {{"primitives",
        {{{"attributes", attributes}, {"indices", wide}, {"material", 0}},
         {{"attributes", attributes}, {"indices", narrow}, {"material", 0}}}}});
  write_bytes(scratch / "m.glb", file.glb());
  const Mesh mesh = io::read_mesh(scratch / "m.glb").mesh;
  CHECK(mesh.triangles == Indices{2, 1, 0, 3, 4, 5});
  CHECK(mesh.positions == Floats{0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0});
  check_close(mesh.uvs, {0, 0.2f, 1, 0.2f, 0, 0.2f, 0, 0.2f, 1, 0.2f, 0, 0.2f});
}

TEST_CASE("glTF: nodes move their meshes, mirrors keep them outward") {
  GltfFile file;
  const int positions = file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0});
  const int normals = file.add_vec3({0, 0, 1, 0, 0, 1, 0, 0, 1});
  file.add_mesh(positions)["attributes"]["NORMAL"] = normals;
  const double h = std::sqrt(0.5);
  file.json["nodes"] = {
      {{"translation", {10, 0, 0}}, {"children", {1, 2}}},
      // 90 degrees about z after a scale
      {{"mesh", 0}, {"rotation", {0, 0, h, h}}, {"scale", {2, 3, 1}}, {"translation", {0, 0, 5}}},
      // x -> -x, written column by column
      {{"mesh", 0}, {"matrix", {-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 7, 1}}},
      {{"mesh", 0}}};
  file.json["scenes"] = {{{"nodes", {3}}}, {{"nodes", {0}}}};
  file.json["scene"] = 1;
  const Mesh mesh = read_gltf_mesh(file.glb()).mesh;
  REQUIRE(mesh.triangle_count() == 2);
  // The last child is walked first.
  check_close(mesh.positions, {10, 0, 7, 9, 0, 7, 10, 1, 7, 10, 0, 5, 10, 2, 5, 7, 0, 5});
  CHECK(mesh.triangles == Indices{0, 2, 1, 3, 4, 5});
  for (std::size_t i = 0; i < 6; ++i) CHECK(mesh.normals[3 * i + 2] == doctest::Approx(1.0));
  file.json.erase("scene");
  CHECK(read_gltf_mesh(file.glb()).mesh.positions == Floats{0, 0, 0, 1, 0, 0, 0, 1, 0});
  file.json.erase("scenes");
  CHECK(read_gltf_mesh(file.glb()).mesh.triangle_count() == 3);
}

TEST_CASE("glTF: colours of vertices are left out with one warning") {
  GltfFile file = GltfFile::square();
  const LogCapture log;
  read_gltf_mesh(file.glb());
  CHECK(log.lines() == 0);
  const int colors = file.add_vec3(Floats(12, 0.5f));
  json& primitives = file.json["meshes"][0]["primitives"];
  primitives[0]["attributes"]["COLOR_0"] = colors;
  primitives.push_back(primitives[0]);
  CHECK(read_gltf_mesh(file.glb()).mesh.triangle_count() == 4);
  CHECK(log.lines() == 1);
  CHECK(log.contains("m.glb: the colours of its vertices are left out"));
  const Scratch scratch;
  write_bytes(scratch / "m.glb", file.glb());
  io::read_mesh(scratch / "m.glb", [](const std::string&) { return false; });
  CHECK(log.lines() == 1);
}

TEST_CASE("glTF: broken scenes are rejected") {
  const auto with_nodes = [](const json& nodes) {
    GltfFile file = GltfFile::square();
    file.json["nodes"] = nodes;
    file.json["scenes"] = {{{"nodes", {0}}}};
    return gltf_mesh_error(file.glb());
  };
  CHECK(contains(with_nodes({{{"mesh", 1}}}), "no mesh 1"));
  CHECK(contains(with_nodes({{{"children", {1}}}}), "no node 1"));
  CHECK(contains(with_nodes({{{"children", {0}}}}), "node 0 has two parents"));
  // Doubling with every level, a short file would make 2^30 instances.
  CHECK(contains(with_nodes({{{"children", {1, 1}}}, {{"mesh", 0}}}), "node 1 has two parents"));
  CHECK(contains(with_nodes({{{"mesh", 0}, {"matrix", {1, 2, 3}}}}), "has 3 numbers, not 16"));
  CHECK(contains(with_nodes({{{"mesh", 0}, {"rotation", {0, 0, 0, 0}}}}), "is zero"));
  CHECK(contains(
      with_nodes({{{"mesh", 0}, {"matrix", {1, 0, 0, 1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}}}),
      "last row"));
  CHECK(contains(with_nodes({{{"name", "empty"}}}), "no triangles"));
}

TEST_CASE("glTF: malformed primitives are rejected") {
  const auto spoilt = [](const std::function<void(json & primitive, GltfFile & file)>& spoil) {
    GltfFile file = GltfFile::square();
    spoil(file.json["meshes"][0]["primitives"][0], file);
    return gltf_mesh_error(file.glb());
  };
  CHECK(contains(spoilt([](json& p, GltfFile& f) {
                   p["indices"] = f.add_indices({0, 1, 4});
                 }),
                 "triangle 0 has the vertex 4"));
  CHECK(contains(spoilt([](json& p, GltfFile& f) {
                   p["indices"] = f.add_indices({0, 1});
                 }),
                 "2 corners"));
  CHECK(contains(spoilt([](json& p, GltfFile&) { p["material"] = 0; }), "no material 0"));
  CHECK(contains(spoilt([](json& p, GltfFile&) { p["attributes"]["POSITION"] = 9; }),
                 "no accessor 9"));
  CHECK(contains(spoilt([](json& p, GltfFile&) {
                   p["attributes"] = {{"COLOR_0", 0}};
                 }),
                 "no POSITION"));
  CHECK(contains(spoilt([](json& p, GltfFile& f) {
                   p["attributes"]["NORMAL"] = f.add_vec3({0, 0, 1});
                 }),
                 "3 normal coordinates where 12"));
  CHECK(contains(spoilt([](json& p, GltfFile& f) {
                   Floats positions = kSquare;
                   positions[7] = std::numeric_limits<float>::quiet_NaN();
                   p["attributes"]["POSITION"] = f.add_vec3(positions);
                 }),
                 "position of vertex 2 is nan"));
  CHECK(contains(spoilt([](json& p, GltfFile& f) {
                   p["attributes"]["POSITION"] = f.add_vec2({0, 0, 1, 0});
                 }),
                 "2 components"));
  CHECK(contains(spoilt([](json&, GltfFile& f) { f.json["accessors"][0]["count"] = 5; }),
                 "5 elements of the accessor 0"));
  CHECK(contains(
      spoilt([](json&, GltfFile& f) { f.json["accessors"][0]["count"] = 18446744073709551615u; }),
      "do not lie within"));
  CHECK(contains(spoilt([](json&, GltfFile& f) {
                   f.json["accessors"][0]["byteOffset"] = 18446744073709551615u;
                 }),
                 "do not lie within"));
  CHECK(contains(spoilt([](json&, GltfFile& f) { f.json["bufferViews"][0]["byteLength"] = 4096; }),
                 "ends beyond its buffer"));
  CHECK(contains(spoilt([](json&, GltfFile& f) {
                   f.json["bufferViews"][0]["byteOffset"] = 18446744073709551615u;
                 }),
                 "ends beyond its buffer"));
  CHECK(contains(spoilt([](json&, GltfFile& f) { f.json["bufferViews"][0]["buffer"] = 3; }),
                 "no buffer"));
  CHECK(contains(spoilt([](json&, GltfFile& f) { f.json["bufferViews"][0]["byteStride"] = 4; }),
                 "do not lie within"));
  CHECK(contains(spoilt([](json&, GltfFile& f) { f.json["accessors"][1]["componentType"] = 5126; }),
                 "do not lie within"));
  CHECK(contains(spoilt([](json&, GltfFile& f) {
                   f.json["accessors"][0]["sparse"] = {
                       {"count", 1},
                       {"indices", {{"bufferView", 1}, {"componentType", 5123}}},
                       {"values", {{"bufferView", 0}}}};
                 }),
                 "sparse"));
  CHECK(contains(spoilt([](json& p, GltfFile&) { p["mode"] = 1; }), "no triangles"));
  CHECK(contains(spoilt([](json& p, GltfFile&) { p.erase("attributes"); }), "attributes"));
}

TEST_CASE("glTF: broken texture coordinates count as none where no texture is laid with them") {
  const auto with_uvs = [](const std::function<int(GltfFile & file)>& add, bool textured) {
    GltfFile file = GltfFile::square();
    const int uvs = add(file);
    json& primitive = file.json["meshes"][0]["primitives"][0];
    primitive["attributes"]["TEXCOORD_0"] = uvs;
    if (textured) {
      primitive["material"] = 0;
      file.json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
      file.json["textures"] = {{{"source", 0}}};
      file.json["images"] = {{{"uri", "p.png"}}};
    }
    const Scratch scratch;
    write_image(scratch / "p.png", Image(1, 1, 3, 0.5f));
    write_bytes(scratch / "m.glb", file.glb());
    return io::read_mesh(scratch / "m.glb");
  };
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const std::vector<std::function<int(GltfFile&)>> broken{
      [&](GltfFile& f) {
        return f.add_vec2({0, 0, 1, 0, 0, nan, 1, 1});
      },
      [](GltfFile& f) {
        return f.add_vec2({0, 0, 1, 0});
      },
      [](GltfFile& f) { return f.add_vec3(kSquare); }, [](GltfFile&) { return 9; }};
  for (const auto& add : broken) {
    const io::MeshFile read = with_uvs(add, false);
    CHECK(read.mesh.uvs.empty());
    CHECK(read.bare == std::vector<bool>{true, true});
    CHECK_THROWS_AS(with_uvs(add, true), DataError);
  }
  const io::MeshFile whole =
      with_uvs([](GltfFile& f) { return f.add_vec2(Floats(8, 0.5f)); }, false);
  CHECK(whole.mesh.uvs == Floats(8, 0.5f));
  CHECK(whole.bare == std::vector<bool>{false, false});
}

TEST_CASE("glTF: many instances of a large mesh are refused before memory runs out") {
  GltfFile file;
  file.add_mesh(file.add_vec3(Floats(3 * 300000, 0.0f)));
  for (int i = 0; i < 1000; ++i) {
    file.json["nodes"].push_back({{"mesh", 0}});
    file.json["scenes"][0]["nodes"].push_back(i);
  }
  CHECK(contains(gltf_mesh_error(file.glb()), "more than 128 million vertices"));
}

TEST_CASE("glTF: truncated and foreign files are rejected") {
  const std::string whole = GltfFile::square().glb();
  CHECK(contains(gltf_mesh_error(whole.substr(0, whole.size() - 1)), "truncated"));
  for (std::size_t size = 0; size < whole.size(); size += 7) gltf_mesh_error(whole.substr(0, size));
  const auto changed = [&](std::size_t at, std::uint32_t value) {
    std::string bytes = whole;
    std::memcpy(bytes.data() + at, &value, 4);
    return gltf_mesh_error(bytes);
  };
  CHECK(contains(changed(4, 1), "version 1"));
  CHECK(contains(changed(8, 0xffffffff), "truncated"));
  CHECK(contains(changed(12, 0xfffffff0), "truncated"));
  CHECK(contains(changed(16, 0), "no JSON"));
  std::uint32_t json_size = 0;
  std::uint32_t bin_size = 0;
  std::memcpy(&json_size, whole.data() + 12, 4);
  std::memcpy(&bin_size, whole.data() + 20 + json_size, 4);
  // Eight bytes too long: tinygltf 2.7 forgets the chunk's header in its check.
  CHECK(contains(changed(20 + json_size, bin_size + 8), "truncated"));
  gltf_mesh_error("{}", "m.gltf");
  gltf_mesh_error("not json", "m.gltf");
  gltf_mesh_error("", "m.gltf");
  CHECK(contains(gltf_mesh_error("{\"asset\":{\"version\":\"2.0\"}}", "m.gltf"), "no triangles"));
  CHECK(contains(gltf_mesh_error(std::string(100000, '['), "m.gltf"), "levels deep"));
  CHECK(contains(gltf_mesh_error("{\"asset\":{\"version\":\"2.0\"},\"extras\":" +
                                     std::string(70, '[') + std::string(70, ']') + "}",
                                 "m.gltf"),
                 "levels deep"));
  CHECK(contains(data_error([] { io::read_mesh("absent.glb"); }), "does not exist"));
}

TEST_CASE("glTF: primitives without normals among others that have them are flat") {
  GltfFile file;
  const int positions = file.add_vec3(kSquare);
  const int normals = file.add_vec3({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0});
  const int indices = file.add_indices({0, 1, 2, 2, 1, 3});
  file.json["meshes"].push_back(
      {{"primitives",
        {{{"attributes", {{"POSITION", positions}, {"NORMAL", normals}}}, {"indices", indices}},
         {{"attributes", {{"POSITION", positions}}}, {"indices", indices}}}}});
  const Mesh mesh = read_gltf_mesh(file.glb()).mesh;
  CHECK(mesh.vertex_count() == 4 + 6);
  for (std::size_t i = 0; i < 12; ++i) {
    const float* normal = &mesh.normals[3 * std::size_t{mesh.triangles[i]}];
    CHECK(normal[i < 6 ? 0 : 2] == 1.0f);
  }
}

TEST_CASE("a mesh alone opens no other file, decodes no picture and has a limit of its own") {
  const auto bytes_of = [](const std::string& text) {
    const auto bytes = std::as_bytes(std::span(text));
    return std::vector<std::byte>(bytes.begin(), bytes.end());
  };
  const auto read_alone = [&](io::MeshFormat format, const std::string& text) {
    return io::read_mesh_alone(format, bytes_of(text), "alone");
  };
  const Scratch scratch;
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  // Read, this material file would be an error.
  write_bytes(scratch / "m.mtl", "newmtl a\nmap_Kd absent.png\n");
  const std::string obj =
      "mtllib " + (scratch / "m.mtl").string() + "\n" + corners + "usemtl a\nf 1 2 3\n";
  write_bytes(scratch / "m.obj", obj);
  CHECK_THROWS_AS(io::read_mesh(scratch / "m.obj"), DataError);
  CHECK(read_alone(io::MeshFormat::kObj, obj).triangle_count() == 1);
  CHECK(contains(
      data_error([&] { read_alone(io::MeshFormat::kGltf, GltfFile::square().gltf("beside.bin")); }),
      "one GLB"));
  GltfFile picture = GltfFile::square();
  picture.json["images"] = {{{"uri", "absent.png"}}, {{"uri", "data:image/png;base64,?"}}};
  CHECK(read_alone(io::MeshFormat::kGltf, picture.glb()).triangle_count() == 2);
  // Small files can place one mesh many times.
  GltfFile many;
  many.add_mesh(many.add_vec3(Floats(3 * 65538, 1.0f)))["mode"] = 6;
  many.json["nodes"] = json::array();
  many.json["scenes"] = {{{"nodes", json::array()}}};
  many.json["scene"] = 0;
  for (int i = 0; i < 33; ++i) {
    many.json["nodes"].push_back({{"mesh", 0}});
    many.json["scenes"][0]["nodes"].push_back(i);
  }
  CHECK(contains(data_error([&] { read_alone(io::MeshFormat::kGltf, many.glb()); }),
                 "more than 2 million"));
  CHECK(read_alone(io::MeshFormat::kGltf, GltfFile::square().glb()).triangle_count() == 2);
  CHECK(contains(data_error([&] { read_alone(io::MeshFormat::kObj, "v 0 0 0\nf 1 2 3\n"); }),
                 "alone"));
}

TEST_CASE("polygons of a mesh alone count as the triangles that they are cut into") {
  // 513 faces of 4096 corners at 4096 places.
  std::string fans;
  for (int i = 0; i < 4096; ++i)
    fans += "v " + std::to_string(std::cos(0.0015 * i)) + " " +
            std::to_string(std::sin(0.0015 * i)) + " 0\n";
  std::string face = "f";
  for (int i = 1; i <= 4096; ++i) face += " " + std::to_string(i);
  for (int i = 0; i < 513; ++i) fans += face + "\n";
  const auto refusal = [](const std::string& obj) {
    const auto bytes = std::as_bytes(std::span(obj));
    return data_error([&] {
      io::read_mesh_alone(io::MeshFormat::kObj, {bytes.begin(), bytes.end()}, "alone.obj");
    });
  };
  CHECK(contains(refusal(fans), "alone.obj has more than 2 million"));
  // Stars, in which most ears hold other corners: cutting many would take minutes.
  std::string stars;
  for (int i = 0; i < 4096; ++i) {
    const double angle = 1.5337 * i;
    const double r = 1 + 0.3 * std::sin(0.7 * i);
    stars += "v " + std::to_string(r * std::cos(angle)) + " " +
             std::to_string(r * std::sin(angle)) + " 0\n";
  }
  for (int i = 0; i < 400; ++i) stars += face + "\n";
  CHECK(contains(refusal(stars), "alone.obj has faces of many corners"));
}
