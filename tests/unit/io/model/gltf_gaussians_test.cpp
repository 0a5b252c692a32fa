// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "io/mesh/mesh_file.hpp"
#include "io/model/model_formats.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "unit/io/gltf_fixture.hpp"
#include "unit/io/model_bytes.hpp"

using namespace raysplats;
using namespace raysplats::test;
using nlohmann::json;

namespace {

constexpr const char* kExtension = "KHR_gaussian_splatting";

/// Two Gaussians of degree 0; rotations as normalized bytes and opacities as in other files.
GltfFile two() {
  GltfFile file;
  json& primitive = file.add_mesh(file.add_vec3({1, 2, 3, -4, 5, -6}));
  const std::string prefix = std::string(kExtension) + ":";
  json& attributes = primitive["attributes"];
  std::string turns = bytes_of({0, 0, 0, 127, 0, 0, 127, 0});
  file.json["accessors"].push_back({{"bufferView", file.add_view(turns)},
                                    {"componentType", 5120},
                                    {"normalized", true},
                                    {"count", 2},
                                    {"type", "VEC4"}});
  attributes[prefix + "ROTATION"] = file.json["accessors"].size() - 1;
  attributes[prefix + "SCALE"] = file.add_vec3({1, 1, 1, 0.5, 1, 2});
  attributes[prefix + "OPACITY"] = file.add_accessor<float>({0.25f, 1.0f}, "SCALAR", 5126);
  attributes[prefix + "SH_DEGREE_0_COEF_0"] = file.add_vec3({0.5, 0, -0.5, 1, 1, 1});
  primitive["mode"] = 0;
  primitive["extensions"][kExtension] = {{"kernel", "ellipse"},
                                         {"colorSpace", "srgb_rec709_display"}};
  file.json["extensionsUsed"] = {kExtension};
  file.json["extensionsRequired"] = {kExtension};
  return file;
}

Gaussians read(const GltfFile& file) {
  const Scratch scratch;
  write_bytes(scratch / "a.glb", file.glb());
  return read_model(scratch / "a.glb");
}

std::string error_of(const GltfFile& file) {
  const std::string message = data_error([&] { read(file); });
  CHECK(!contains(message, "\n"));
  return message;
}

json& extension_of(GltfFile& file) {
  return file.json["meshes"][0]["primitives"][0]["extensions"][kExtension];
}

}  // namespace

TEST_CASE("glTF Gaussians: attributes of other programs, turned to the y down of captures") {
  const Gaussians model = read(two());
  REQUIRE(model.size() == 2);
  CHECK(model.means == std::vector<float>{-1, -2, 3, 4, -5, -6});
  CHECK(farthest(model.log_scales, {0, 0, 0, std::log(0.5f), 0, std::log(2.0f)}) < 1e-6);
  // Half a turn about z each: the second one was turned so already.
  CHECK(farthest_rotation(model.quaternions, {0, 0, 0, 1, 1, 0, 0, 0}) < 1e-6);
  CHECK(1 / (1 + std::exp(-model.opacities[0])) == doctest::Approx(0.25));
  CHECK(std::isfinite(model.opacities[1]));
  CHECK(model.opacities[1] > 10);
  CHECK(model.sh == std::vector<float>{0.5, 0, -0.5, 1, 1, 1});
}

TEST_CASE("glTF Gaussians: nodes move and scale, and may show a mesh twice") {
  GltfFile file = two();
  file.json["nodes"] = {{{"mesh", 0}, {"translation", {10, 0, 0}}, {"scale", {2, 2, 2}}},
                        {{"mesh", 0}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  const Gaussians model = read(file);
  REQUIRE(model.size() == 4);
  const std::size_t moved = model.means[2] == 6.0f ? 0 : 2;
  CHECK(model.means[3 * moved] == -12.0f);
  CHECK(model.log_scales[3 * moved] == doctest::Approx(std::log(2.0)));
  for (int i = 0; i < 100; ++i) {
    file.json["nodes"].push_back({{"mesh", 0}});
    file.json["scenes"][0]["nodes"].push_back(2 + i);
  }
  CHECK(contains(error_of(file), "show 204 Gaussians, more than 64 times the 2 that it holds"));
}

TEST_CASE("glTF Gaussians: how often nodes may show a mesh does not go by their order") {
  GltfFile file = two();
  file.json["meshes"].push_back(file.json["meshes"][0]);
  file.json["nodes"] = {{{"mesh", 1}}};
  json order = json::array();
  for (int i = 1; i <= 65; ++i) {
    file.json["nodes"].push_back({{"mesh", 0}});
    order.push_back(i);
  }
  for (const bool first : {true, false}) {
    file.json["scenes"] = {{{"nodes", order}}};
    file.json["scenes"][0]["nodes"].insert(
        first ? file.json["scenes"][0]["nodes"].begin() : file.json["scenes"][0]["nodes"].end(), 0);
    CHECK(read(file).size() == 132);
  }
}

TEST_CASE("glTF Gaussians: a written GLB reads back as it was, but for harmonics of degree 4") {
  const Scratch scratch;
  for (int degree = 0; degree <= 4; ++degree) {
    const Gaussians model = trained_like(37, degree);
    write_model(scratch / "a.glb", model);
    const Gaussians again = read_model(scratch / "a.glb");
    CHECK(again.sh_degree == std::min(degree, 3));
    CHECK(again.means == model.means);
    CHECK(farthest(again.log_scales, model.log_scales) < 1e-5);
    CHECK(farthest(again.opacities, model.opacities) < 1e-3);
    CHECK(farthest_rotation(again.quaternions, model.quaternions) < 1e-6);
    CHECK(farthest(again.sh, with_sh_degree(model, again.sh_degree).sh) < 1e-6);
  }
  const std::string bytes = read_bytes(scratch / "a.glb");
  const json written = json::parse(bytes.substr(
      20, static_cast<unsigned char>(bytes[12]) + 256u * static_cast<unsigned char>(bytes[13])));
  CHECK(written["extensionsUsed"] == json{kExtension});
  const json& primitive = written["meshes"][0]["primitives"][0];
  CHECK(primitive["mode"] == 0);
  CHECK(primitive["extensions"][kExtension]["kernel"] == "ellipse");
  CHECK(primitive["attributes"].size() == 4 + 16);
  CHECK(written["accessors"][0]["min"].size() == 3);
  CHECK(bytes.size() % 4 == 0);
  Gaussians none;
  CHECK(contains(data_error([&] { write_model(scratch / "b.glb", none); }), "no Gaussians"));
}

TEST_CASE("glTF Gaussians: GLBs of one and about 256 Gaussians read back as they were") {
  const Scratch scratch;
  for (const std::size_t count : {1u, 255u, 256u, 257u}) {
    CAPTURE(count);
    const Gaussians model = trained_like(count, 2);
    write_model(scratch / "a.glb", model);
    const Gaussians again = read_model(scratch / "a.glb");
    CHECK(again.size() == count);
    CHECK(again.means == model.means);
    CHECK(farthest(again.opacities, model.opacities) < 1e-3);
    CHECK(farthest(again.sh, model.sh) < 1e-6);
  }
}

TEST_CASE("glTF Gaussians: meshes and Gaussians of one file are told apart") {
  const Scratch scratch;
  GltfFile file = two();
  file.add_mesh(file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  write_bytes(scratch / "a.glb", file.glb());
  CHECK(io::has_gltf_gaussians(scratch / "a.glb"));
  CHECK(read_model(scratch / "a.glb").size() == 2);
  CHECK(io::read_mesh(scratch / "a.glb").mesh.triangle_count() == 1);
  GltfFile mesh;
  mesh.add_mesh(mesh.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0}));
  write_bytes(scratch / "m.glb", mesh.glb());
  CHECK(!io::has_gltf_gaussians(scratch / "m.glb"));
  CHECK(contains(data_error([&] { read_model(scratch / "m.glb"); }), kExtension));
}

TEST_CASE("glTF Gaussians: what is not understood or damaged ends in one sentence") {
  GltfFile file = two();
  extension_of(file)["kernel"] = "box";
  CHECK(contains(error_of(file), "box"));
  file = two();
  extension_of(file)["colorSpace"] = "lin_rec709_display";
  CHECK(contains(error_of(file), "lin_rec709_display"));
  file = two();
  extension_of(file)["extensions"]["KHR_gaussian_splatting_compression_spz_2"] = {
      {"bufferView", 0}};
  file.json["extensionsRequired"].push_back("KHR_gaussian_splatting_compression_spz_2");
  CHECK(contains(error_of(file), "spz_2"));
  file = two();
  file.json["meshes"][0]["primitives"][0]["attributes"].erase(std::string(kExtension) + ":SCALE");
  CHECK(contains(error_of(file), "SCALE"));
  const std::string harmonic = std::string(kExtension) + ":SH_DEGREE_1_COEF_";
  for (int missing = 0; missing < 3; ++missing) {
    file = two();
    json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
    for (int n = 0; n < 3; ++n) {
      if (n != missing) attributes[harmonic + std::to_string(n)] = attributes["POSITION"];
    }
    CHECK(contains(error_of(file), "Gaussians have no " + harmonic + std::to_string(missing)));
  }
  file = two();
  file.json["accessors"][0]["count"] = 1000000000;
  CHECK(contains(error_of(file), "do not lie within"));
  file = two();
  file.json["meshes"][0]["primitives"][0]["mode"] = 4;
  CHECK(contains(error_of(file), "POINTS"));
  file = two();
  const float nan = std::nanf("");
  file.buffer.replace(0, 4, reinterpret_cast<const char*>(&nan), 4);
  CHECK(contains(error_of(file), "not finite"));
}

TEST_CASE("glTF Gaussians: a packed form is passed over where the numbers are there too") {
  GltfFile file = two();
  extension_of(file)["extensions"]["KHR_gaussian_splatting_compression_spz_2"] = {
      {"bufferView", 0}};
  CHECK(read(file).means == std::vector<float>{-1, -2, 3, 4, -5, -6});
  json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  const json whole = attributes;
  attributes.erase(std::string(kExtension) + ":ROTATION");
  CHECK(contains(error_of(file), "packed by KHR_gaussian_splatting_compression_spz_2"));
  attributes = whole;
  file.json["accessors"][1].erase("bufferView");
  CHECK(contains(error_of(file), "packed by KHR_gaussian_splatting_compression_spz_2"));
}

TEST_CASE("glTF Gaussians: logarithms for scales are taken for what they may be") {
  GltfFile file = two();
  const std::string scale = std::string(kExtension) + ":SCALE";
  file.json["meshes"][0]["primitives"][0]["attributes"][scale] =
      file.add_vec3({-4, -4, -5, -3, -2, -4});
  CHECK(contains(error_of(file), "a logarithm perhaps, as splat-transform wrote them"));
}
