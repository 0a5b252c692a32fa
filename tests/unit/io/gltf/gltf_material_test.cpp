// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "io/mesh/mesh_file.hpp"
#include "raysplats/io.hpp"
#include "unit/io/gltf_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;
using nlohmann::json;
using Kind = Material::Kind;

namespace {

Material mapped(const json& material) {
  const Scratch scratch;
  write_bytes(scratch / "m.glb", GltfFile::triangle_with(material).glb());
  const io::MeshFile file = io::read_mesh(scratch / "m.glb");
  REQUIRE(file.materials.size() == 1);
  return file.materials[0];
}

json pbr(double metallic, double roughness) {
  return {{"pbrMetallicRoughness",
           {{"baseColorFactor", {1.0, 0.5, 0.0, 0.25}},
            {"metallicFactor", metallic},
            {"roughnessFactor", roughness}}}};
}

void check_color(const Rgb& color, double r, double g, double b) {
  CHECK(color[0] == doctest::Approx(r).epsilon(1e-3));
  CHECK(color[1] == doctest::Approx(g).epsilon(1e-3));
  CHECK(color[2] == doctest::Approx(b).epsilon(1e-3));
}

/// sRGB's display value of a half, of linear light.
constexpr double kHalf = 0.7354;

/// The bytes of a 2 x 2 PNG: red, green / blue, white.
std::string png() {
  const Scratch scratch;
  Image image(2, 2, 3);
  image.data = {1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
  write_image(scratch / "t.png", image);
  return read_bytes(scratch / "t.png");
}

GltfFile textured(const json& material) {
  GltfFile file = GltfFile::triangle_with(material);
  const int uvs = file.add_vec2({0, 0, 1, 0, 0.5f, 1});
  const int second = file.add_vec2({1, 1, 1, 1, 1, 1});
  json& attributes = file.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["TEXCOORD_0"] = uvs;
  attributes["TEXCOORD_1"] = second;
  file.json["textures"].push_back({{"source", 0}});
  return file;
}

json base_texture(const json& info) {
  return {{"pbrMetallicRoughness", {{"baseColorTexture", info}}}};
}

}  // namespace

TEST_CASE("glTF materials: metallic and roughness choose between mirror and diffuse") {
  for (const double metallic : {0.5, 1.0}) {
    const Material mirror = mapped(pbr(metallic, 0.5));
    CHECK(mirror.kind == Kind::kMirror);
    check_color(mirror.color, 1.0, kHalf, 0.0);
    CHECK(mirror.roughness == 0.5f);
  }
  CHECK(mapped(pbr(0.49, 0.1)).kind == Kind::kDiffuse);
  CHECK(mapped(pbr(1.0, 0.51)).kind == Kind::kDiffuse);
  // The defaults are metallic 1 and roughness 1.
  const Material plain = mapped(json::object());
  CHECK(plain.kind == Kind::kDiffuse);
  CHECK(plain.color == Rgb{1, 1, 1});
  CHECK(plain.name == "material 0");
}

TEST_CASE("glTF materials: the specular lobe has the strength and width of the roughness") {
  json rough = pbr(0.0, 0.5);
  rough["name"] = "clay";
  const Material clay = mapped(rough);
  CHECK(clay.name == "clay");
  CHECK(clay.roughness == 0.5f);
  // F0 = 0.04, k = 2 / 0.5^4 - 2 = 30
  CHECK(clay.specular == doctest::Approx(0.04 * 38.0 / 8.0));
  CHECK(mapped(pbr(0.0, 0.0)).specular == 1.0f);
  rough["extensions"]["KHR_materials_ior"]["ior"] = 2.0;
  CHECK(mapped(rough).specular == doctest::Approx(38.0 / 8.0 / 9.0));
}

TEST_CASE("glTF materials: transmission makes glass with its index and absorption") {
  json material = pbr(0.0, 0.0);
  material["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 0.5;
  material["extensions"]["KHR_materials_volume"]["thicknessFactor"] = 0.1;
  const Material glass = mapped(material);
  CHECK(glass.kind == Kind::kGlass);
  CHECK(glass.ior == 1.5f);
  check_color(glass.color, 1.0, kHalf, 0.0);
  CHECK(glass.absorption == Rgb{0, 0, 0});
  material["extensions"]["KHR_materials_ior"]["ior"] = 1.33;
  material["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 0.1},
                                                    {"attenuationDistance", 2.0},
                                                    {"attenuationColor", {1.0, 0.5, 0.0}}};
  const Material tinted = mapped(material);
  CHECK(tinted.ior == 1.33f);
  check_color(tinted.absorption, 0.0, -std::log(kHalf) / 2.0, -std::log(1e-4) / 2.0);
  material["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 0.49;
  CHECK(mapped(material).kind == Kind::kDiffuse);
  // Only a blended alpha counts, and glass comes first.
  material["alphaMode"] = "BLEND";
  CHECK(mapped(material).kind == Kind::kTransparent);
  material["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 1.0;
  CHECK(mapped(material).kind == Kind::kGlass);
}

TEST_CASE("glTF materials: light goes straight through open glass without a volume") {
  const auto glass_of = [](const json& volume, const std::vector<std::uint16_t>& corners) {
    json material = pbr(0.0, 0.0);
    material["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 1.0;
    if (!volume.is_null()) material["extensions"]["KHR_materials_volume"] = volume;
    GltfFile file;
    const int positions = file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1});
    const int indices = file.add_indices(corners);
    json& primitive = file.add_mesh(positions);
    primitive["indices"] = indices;
    primitive["material"] = 0;
    file.json["materials"].push_back(material);
    return read_gltf_mesh(file.glb()).materials.at(0);
  };
  const std::vector<std::uint16_t> pane{0, 1, 2}, body{0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
  const json without, thin{{"attenuationDistance", 2.0}, {"attenuationColor", {0.5, 0.5, 0.5}}};
  json thick = thin;
  thick["thicknessFactor"] = 0.1;
  for (const json& volume : {without, thin}) {
    const Material straight = glass_of(volume, pane);
    CHECK(straight.kind == Kind::kGlass);
    CHECK(straight.ior == 1.0f);
    CHECK(straight.absorption == Rgb{0, 0, 0});
    check_color(straight.color, 1.0, kHalf, 0.0);
    CHECK(glass_of(volume, body).ior == 1.5f);
  }
  CHECK(glass_of(thin, body).absorption[0] > 0.0f);
  CHECK(glass_of(thick, pane).ior == 1.5f);
  CHECK(glass_of(thick, pane).absorption[0] > 0.0f);
}

TEST_CASE("glTF materials: alpha of a texture that would cut out is left out with one warning") {
  const auto lines = [](const std::string& mode, float alpha) {
    const Scratch scratch;
    Image leaf(2, 1, 4, 1.0f);
    leaf.data[7] = alpha;
    write_image(scratch / "leaf.png", leaf);
    json material = base_texture({{"index", 0}});
    material["name"] = "leaf";
    material["alphaMode"] = mode;
    GltfFile file = textured(material);
    file.json["images"].push_back({{"uri", "leaf.png"}});
    file.json["materials"].push_back(material);
    json& primitives = file.json["meshes"][0]["primitives"];
    primitives.push_back(primitives[0]);
    primitives[1]["material"] = 1;
    write_bytes(scratch / "m.glb", file.glb());
    const LogCapture log;
    io::read_mesh(scratch / "m.glb");
    CHECK(log.contains("m.glb: the alpha of the texture of the material 'leaf'") ==
          (log.lines() > 0));
    return log.lines();
  };
  for (const std::string mode : {"MASK", "BLEND"}) {
    CHECK(lines(mode, 0.0f) == 1);
    CHECK(lines(mode, 1.0f) == 0);
  }
  CHECK(lines("OPAQUE", 0.0f) == 0);
}

TEST_CASE("glTF materials: blended alpha makes transparent, even of metal") {
  json material = pbr(1.0, 0.1);
  material["alphaMode"] = "OPAQUE";
  CHECK(mapped(material).kind == Kind::kMirror);
  material["alphaMode"] = "BLEND";
  const Material clear = mapped(material);
  CHECK(clear.kind == Kind::kTransparent);
  CHECK(clear.opacity == 0.25f);
}

TEST_CASE("glTF materials: masked alpha below the cutoff shows nothing") {
  json material = pbr(1.0, 0.1);
  material["emissiveFactor"] = {1, 1, 1};
  material["alphaMode"] = "MASK";
  const Material unseen = mapped(material);
  CHECK(unseen.kind == Kind::kTransparent);
  CHECK(unseen.opacity == 0.0f);
  CHECK(unseen.emission == Rgb{0, 0, 0});
  material["alphaCutoff"] = 0.25;
  CHECK(mapped(material).kind == Kind::kMirror);
}

TEST_CASE("glTF materials: emission with its strength") {
  json material = pbr(0.0, 1.0);
  material["emissiveFactor"] = {0.5, 1.0, 0.0};
  const Material glow = mapped(material);
  CHECK(glow.kind == Kind::kDiffuse);
  check_color(glow.emission, kHalf, 1.0, 0.0);
  material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = 8.0;
  const double eight = 1.055 * std::pow(8.0, 1.0 / 2.4) - 0.055;
  CHECK(mapped(material).emission[1] == doctest::Approx(eight));
  material["pbrMetallicRoughness"]["baseColorFactor"] = {0, 0, 0, 1};
  CHECK(mapped(material).kind == Kind::kEmissive);
}

TEST_CASE("glTF materials: textures from a buffer, a data URI and a file") {
  const std::string bytes = png();
  const auto check = [](const io::MeshFile& file) {
    REQUIRE(file.textures.size() == 1);
    CHECK(file.textures[0].width == 2);
    CHECK(file.textures[0].data == std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1});
    CHECK(file.materials[0].texture == 0);
    CHECK(file.mesh.uvs == std::vector<float>{0, 0, 1, 0, 0.5f, 1});
  };
  const Scratch scratch;
  GltfFile embedded = textured(base_texture({{"index", 0}}));
  const int view = embedded.add_view(bytes);
  embedded.json["images"].push_back({{"bufferView", view}, {"mimeType", "image/png"}});
  write_bytes(scratch / "a.glb", embedded.glb());
  check(io::read_mesh(scratch / "a.glb"));

  GltfFile data = textured(base_texture({{"index", 0}}));
  data.json["images"].push_back({{"uri", "data:image/png;base64," + base64(bytes)}});
  write_bytes(scratch / "b.glb", data.glb());
  check(io::read_mesh(scratch / "b.glb"));

  GltfFile external = textured(base_texture({{"index", 0}}));
  external.json["images"].push_back({{"uri", "maps/my%20t.png"}});
  write_bytes(scratch / "c.glb", external.glb());
  write_bytes(scratch / "maps/my t.png", bytes);
  check(io::read_mesh(scratch / "c.glb"));

  fs::remove(scratch / "maps/my t.png");
  CHECK(contains(data_error([&] { io::read_mesh(scratch / "c.glb"); }), "my%20t.png"));
  const io::MeshFile unseen =
      io::read_mesh(scratch / "c.glb", [](const std::string&) { return false; });
  CHECK(unseen.textures.empty());
  CHECK(unseen.materials.at(0).texture == -1);
  write_bytes(scratch / "maps/my t.png", bytes.substr(0, bytes.size() - 9));
  CHECK(contains(data_error([&] { io::read_mesh(scratch / "c.glb"); }), "truncated or damaged"));
  write_bytes(scratch / "maps/my t.png", "GIF89a");
  CHECK(contains(data_error([&] { io::read_mesh(scratch / "c.glb"); }), "neither a PNG nor"));

  // What lies outside of the buffer is not touched.
  embedded.json["bufferViews"][static_cast<std::size_t>(view)]["byteOffset"] = 1u << 30;
  write_bytes(scratch / "a.glb", embedded.glb());
  CHECK(contains(data_error([&] { io::read_mesh(scratch / "a.glb"); }), "beyond its buffer"));
}

TEST_CASE("glTF materials: data: URIs of any media type") {
  const std::string bytes = png();
  const Scratch scratch;
  const auto read = [&](const std::string& uri) {
    GltfFile file = textured(base_texture({{"index", 0}}));
    file.json["images"].push_back({{"uri", uri}});
    write_bytes(scratch / "m.glb", file.glb());
    return io::read_mesh(scratch / "m.glb");
  };
  for (const std::string start : {"data:;base64,", "data:image/x-png;base64,",
                                  "DATA:image/png;Base64,", "data:image/png;name=a.png;base64,"}) {
    CAPTURE(start);
    CHECK(read(start + base64(bytes)).textures.at(0).data ==
          std::vector<float>{1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1});
  }
  const std::string other = data_error([&] { read("data:image/webp;base64," + base64("RIFF")); });
  CHECK(contains(other, "neither a PNG nor"));
  const std::string broken =
      data_error([&] { read("data:image/png;base64," + std::string(5000, '?')); });
  CHECK(contains(broken, "the image 0 has a data: URI that cannot be decoded"));
  CHECK(broken.size() < 400);
  CHECK(data_error([&] { read(std::string(5000, 'a')); }).size() < 400);
}

TEST_CASE("glTF materials: an image that no triangle uses may be missing") {
  const Scratch scratch;
  GltfFile file = GltfFile::triangle_with(json::object());
  file.json["materials"].push_back(base_texture({{"index", 0}}));
  file.json["textures"].push_back({{"source", 0}});
  file.json["images"].push_back({{"uri", "gone.png"}});
  write_bytes(scratch / "m.glb", file.glb());
  const io::MeshFile read = io::read_mesh(scratch / "m.glb");
  CHECK(read.materials.size() == 1);
  CHECK(read.textures.empty());
}

TEST_CASE("glTF materials: texture coordinates follow their set and transform") {
  const Scratch scratch;
  const auto uvs = [&](const json& info) {
    GltfFile file = textured(base_texture(info));
    file.json["images"].push_back({{"uri", "data:image/png;base64," + base64(png())}});
    write_bytes(scratch / "m.glb", file.glb());
    return io::read_mesh(scratch / "m.glb").mesh.uvs;
  };
  CHECK(uvs({{"index", 0}, {"texCoord", 1}}) == std::vector<float>{1, 1, 1, 1, 1, 1});
  CHECK(uvs({{"index", 0}, {"texCoord", 7}}).empty());
  // A material of a scene file may have a texture where the file's own has none.
  write_bytes(scratch / "m.glb", textured(json::object()).glb());
  CHECK(io::read_mesh(scratch / "m.glb").mesh.uvs == std::vector<float>{0, 0, 1, 0, 0.5f, 1});
  const auto moved = uvs(
      {{"index", 0},
       {"extensions",
        {{"KHR_texture_transform",
          {{"offset", {0.5, 0.25}}, {"scale", {2.0, 4.0}}, {"rotation", std::numbers::pi / 2}}}}}});
  // A quarter turn counter-clockwise takes +u to -v and +v to +u (v points down).
  const std::vector<float> expected{0.5f, 0.25f, 0.5f, -1.75f, 4.5f, -0.75f};
  REQUIRE(moved.size() == 6);
  for (std::size_t i = 0; i < 6; ++i) CHECK(moved[i] == doctest::Approx(expected[i]));
}

TEST_CASE("glTF materials: a sampler that does not repeat is told of once, where it matters") {
  const auto told = [](const json& sampler, const std::vector<float>& uvs) {
    GltfFile file = GltfFile::triangle_with(base_texture({{"index", 0}}));
    file.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] = file.add_vec2(uvs);
    file.json["meshes"][0]["primitives"].push_back(file.json["meshes"][0]["primitives"][0]);
    file.json["images"].push_back({{"uri", "data:image/png;base64," + base64(png())}});
    file.json["textures"].push_back({{"source", 0}, {"sampler", 0}});
    file.json["samplers"].push_back(sampler);
    const LogCapture log;
    read_gltf_mesh(file.glb());
    CHECK(log.lines() == (log.contains("m.glb: the wrapping of the texture") ? 1 : 0));
    return log.lines() == 1;
  };
  const std::vector<float> within{0, 0, 1, 0, 0.5f, 1};
  const std::vector<float> wide{0, 0, 1, 0, 0.5f, 2};
  const std::vector<float> left{-1, 0, 1, 0, 0.5f, 1};
  CHECK(told({{"wrapT", 33071}}, wide));
  CHECK(told({{"wrapS", 33648}}, left));
  CHECK_FALSE(told({{"wrapS", 33071}}, wide));
  CHECK_FALSE(told({{"wrapS", 33071}, {"wrapT", 33648}}, within));
  CHECK_FALSE(told({{"wrapS", 10497}, {"wrapT", 10497}}, wide));
  CHECK_FALSE(told({{"wrapT", "clamp"}}, wide));
  CHECK_FALSE(told(json::object(), wide));
}

TEST_CASE("glTF materials: textures of other properties count with their mean") {
  const Scratch scratch;
  json material = pbr(1.0, 1.0);
  material["pbrMetallicRoughness"]["metallicRoughnessTexture"]["index"] = 0;
  material["emissiveFactor"] = {1.0, 1.0, 1.0};
  material["emissiveTexture"]["index"] = 0;
  GltfFile file = textured(material);
  file.json["images"].push_back({{"uri", "data:image/png;base64," + base64(png())}});
  write_bytes(scratch / "m.glb", file.glb());
  const io::MeshFile read = io::read_mesh(scratch / "m.glb");
  // Every channel of the picture is 1 in two of its four pixels.
  CHECK(read.materials[0].kind == Kind::kMirror);
  CHECK(read.materials[0].roughness == 0.5f);
  check_color(read.materials[0].emission, 0.5, 0.5, 0.5);
  CHECK(read.textures.empty());
}

TEST_CASE("glTF materials: specular and glossiness in place of metallic and roughness") {
  json material = pbr(0.0, 1.0);  // a fallback for others
  json& given = material["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  given = {{"diffuseFactor", {1.0, 0.5, 0.0, 0.25}},
           {"specularFactor", {0.0, 0.04, 0.0}},
           {"glossinessFactor", 0.5}};
  const Material plain = mapped(material);
  CHECK(plain.kind == Kind::kDiffuse);
  const double half = 1.055 * std::pow(0.5 * 0.96, 1.0 / 2.4) - 0.055;
  check_color(plain.color, 1.055 * std::pow(0.96, 1.0 / 2.4) - 0.055, half, 0.0);
  CHECK(plain.roughness == 0.5f);
  CHECK(plain.specular == doctest::Approx(0.04 * 38.0 / 8.0));
  material["alphaMode"] = "BLEND";
  CHECK(mapped(material).opacity == 0.25f);
  material["alphaMode"] = "OPAQUE";
  given["specularFactor"] = {1.0, 0.5, 0.0};
  const Material gold = mapped(material);
  CHECK(gold.kind == Kind::kMirror);
  check_color(gold.color, 1.0, kHalf, 0.0);
  CHECK(gold.roughness == 0.5f);
  given["glossinessFactor"] = 0.25;
  CHECK(mapped(material).kind == Kind::kDiffuse);
  check_color(mapped(material).color, 1.0, kHalf, 0.0);
  // By default a perfect mirror.
  given = json::object();
  const Material silver = mapped(material);
  CHECK(silver.kind == Kind::kMirror);
  CHECK(silver.color == Rgb{1, 1, 1});
  CHECK(silver.roughness == 0.0f);
}

TEST_CASE("glTF materials: the textures of specular and glossiness") {
  const Scratch scratch;
  Image mixed(1, 2, 4);
  mixed.data = {0.2f, 0, 0, 0.2f, 0.2f, 0, 0, 0.6f};
  write_image(scratch / "mixed.png", mixed);
  json material;
  json& given = material["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  given = {{"diffuseTexture", {{"index", 0}, {"texCoord", 1}}},
           {"specularGlossinessTexture", {{"index", 1}}}};
  GltfFile file = textured(material);
  file.json["textures"].push_back({{"source", 1}});
  file.json["images"] = {{{"uri", "data:image/png;base64," + base64(png())}},
                         {{"uri", "mixed.png"}}};
  file.json["extensionsRequired"] = {"KHR_materials_pbrSpecularGlossiness"};
  write_bytes(scratch / "m.glb", file.glb());
  const io::MeshFile read = io::read_mesh(scratch / "m.glb");
  REQUIRE(read.textures.size() == 1);
  CHECK(read.textures[0].width == 2);
  CHECK(read.materials.at(0).texture == 0);
  CHECK(read.mesh.uvs == std::vector<float>{1, 1, 1, 1, 1, 1});
  CHECK(read.materials[0].kind == Kind::kDiffuse);
  CHECK(read.materials[0].roughness == doctest::Approx(0.6).epsilon(1e-6));
  // Light of the display value 0.2 is reflected, and the rest of white is left.
  const double reflected = std::pow((0.2 + 0.055) / 1.055, 2.4);
  check_color(read.materials[0].color, 1.055 * std::pow(1 - reflected, 1.0 / 2.4) - 0.055,
              read.materials[0].color[0], read.materials[0].color[0]);
}

TEST_CASE("glTF materials: hostile numbers stay in range") {
  json material = {{"emissiveFactor", {-1.0, 1e300, 1e300}},
                   {"alphaMode", "BLEND"},
                   {"pbrMetallicRoughness",
                    {{"baseColorFactor", {-5.0, 1e300, 0.5, -2.0}},
                     {"metallicFactor", -1e300},
                     {"roughnessFactor", 1e300}}}};
  material["extensions"]["KHR_materials_emissive_strength"]["emissiveStrength"] = 1e300;
  material["extensions"]["KHR_materials_ior"]["ior"] = -7.0;
  const Material mild = mapped(material);
  for (const float value : mild.color) CHECK((value >= 0.0f && value <= 1.0f));
  for (const float value : mild.emission) CHECK((value >= 0.0f && std::isfinite(value)));
  CHECK(mild.opacity == 0.0f);
  CHECK(mild.roughness == 1.0f);
  material["extensions"]["KHR_materials_transmission"]["transmissionFactor"] = 1e300;
  material["extensions"]["KHR_materials_volume"] = {{"thicknessFactor", 1e300},
                                                    {"attenuationDistance", 1e-300},
                                                    {"attenuationColor", {-1.0, 1e300, 0.5}}};
  const Material glass = mapped(material);
  CHECK(glass.ior == 1.0f);
  for (const float value : glass.absorption) CHECK((value >= 0.0f && std::isfinite(value)));
  json other;
  other["extensions"]["KHR_materials_pbrSpecularGlossiness"] = {
      {"diffuseFactor", {-5.0, 1e300}}, {"specularFactor", "x"}, {"glossinessFactor", -1e300}};
  const Material rough = mapped(other);
  for (const float value : rough.color) CHECK((value >= 0.0f && value <= 1.0f));
  CHECK(rough.roughness == 1.0f);
}
