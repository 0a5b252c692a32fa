// SPDX-License-Identifier: Apache-2.0
// What a glTF file consists of, embeds, needs and has too much of.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cstdint>
#include <string>
#include <vector>

#include "io/data_uri.hpp"
#include "io/mesh/mesh_file.hpp"
#include "unit/io/gltf_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;
using nlohmann::json;
using Indices = std::vector<std::uint32_t>;

TEST_CASE("data: URIs in base64 and percent-encoded") {
  const auto decoded = [](const std::string& uri) -> std::string {
    const auto bytes = io::decode_data_uri(uri);
    return bytes ? std::string(bytes->begin(), bytes->end()) : "none";
  };
  for (const std::string text : {"", "a", "ab", "abc", "abcd"}) {
    CHECK(decoded("data:text/plain;base64," + base64(text)) == text);
  }
  CHECK(decoded("data:;base64,YQ") == "a");
  CHECK(decoded("data:;base64,%59%51%3D%3d") == "a");
  CHECK(decoded("data:;base64,+/+/") == "\xfb\xff\xbf");
  CHECK(decoded("data:,a%20b%2x%4") == "a b%2x%4");
  CHECK(decoded("data:;base64,Y") == "none");
  CHECK(decoded("data:;base64,Y*==") == "none");
  CHECK(decoded("data:base64") == "none");
  CHECK(decoded("file.bin") == "none");
  CHECK(!io::is_data_uri("dat"));
}

TEST_CASE("glTF: files that need what is not supported are refused by its name") {
  const auto refused = [](const GltfFile& file, const std::string& extension) {
    GltfFile needing = file;
    needing.json["extensionsUsed"] = needing.json["extensionsRequired"] = {extension};
    CHECK(contains(gltf_mesh_error(needing.glb()), "needs the extension " + extension));
    CHECK(contains(gltf_mesh_error(needing.gltf("absent.bin"), "m.gltf"),
                   "needs the extension " + extension));
  };
  // Of compressed primitives only the counts and types are stated.
  GltfFile draco = GltfFile::square();
  for (json& accessor : draco.json["accessors"]) accessor.erase("bufferView");
  draco.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", 0}, {"attributes", {{"POSITION", 0}}}};
  refused(draco, "KHR_draco_mesh_compression");
  // A second buffer is to be filled when the first one is unpacked.
  GltfFile meshopt = GltfFile::square();
  meshopt.json["buffers"] = {
      {{"byteLength", 64}, {"extensions", {{"EXT_meshopt_compression", {{"fallback", true}}}}}}};
  refused(meshopt, "EXT_meshopt_compression");
  refused(GltfFile::square(), "KHR_materials_unheard_of");
  GltfFile known = GltfFile::square();
  known.json["extensionsRequired"] = {"KHR_materials_clearcoat", "KHR_mesh_quantization"};
  CHECK(read_gltf_mesh(known.glb()).mesh.triangle_count() == 2);
  known.json["extensionsRequired"] = {7};
  CHECK(contains(gltf_mesh_error(known.glb()), "no text"));
}

TEST_CASE("glTF: what is left out may be in any form") {
  GltfFile file = GltfFile::square();
  file.json["nodes"] = {{{"mesh", 0}, {"skin", 0}, {"camera", 0}}, {{"name", "bone"}}};
  file.json["scenes"] = {{{"nodes", {0, 1}}}};
  // The inverse bind matrices of a skin are optional.
  file.json["skins"] = {{{"joints", {1}}}, {{"joints", {1}}, {"skeleton", "none"}}};
  file.json["animations"] = {{{"channels", {{{"sampler", 0}}}}}};
  file.json["cameras"] = {{{"type", "fisheye"}}};
  file.json["samplers"] = {{{"wrapS", "clamp"}}};
  file.json["extensions"]["KHR_lights_punctual"]["lights"] = {{{"type", 3}}};
  CHECK(read_gltf_mesh(file.glb()).mesh.triangle_count() == 2);
}

TEST_CASE("glTF: copies that are left out are told of") {
  GltfFile file = GltfFile::square();
  file.json["nodes"] = {
      {{"mesh", 0},
       {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", {{"TRANSLATION", 0}}}}}}}}};
  file.json["extensionsUsed"] = {"EXT_mesh_gpu_instancing"};
  const LogCapture log;
  CHECK(read_gltf_mesh(file.glb()).mesh.triangle_count() == 2);
  CHECK(log.lines() == 1);
  CHECK(log.contains("EXT_mesh_gpu_instancing"));
}

TEST_CASE("glTF: buffers of data: URIs, longer than needed, absent, and too short") {
  const GltfFile file = GltfFile::square();
  const auto triangles = [&](const std::string& uri) {
    return read_gltf_mesh(file.gltf(uri), "m.gltf").mesh.triangles;
  };
  const Indices expected{0, 1, 2, 2, 1, 3};
  CHECK(triangles("data:application/octet-stream;charset=utf-8;base64," + base64(file.buffer)) ==
        expected);
  CHECK(triangles("data:;base64," + base64(file.buffer + "more")) == expected);
  std::string percent = "data:,";
  for (const char c : file.buffer) percent += fmt::format("%{:02X}", static_cast<unsigned char>(c));
  CHECK(triangles(percent) == expected);
  const auto error = [&](const std::string& uri) {
    return gltf_mesh_error(file.gltf(uri), "m.gltf");
  };
  const std::string bytes = base64(file.buffer);
  CHECK(contains(error("data:;base64," + bytes.substr(0, 16)), "the buffer 0 has 12 bytes of 60"));
  CHECK(contains(error("data:;base64," + bytes + "!"), "cannot be decoded"));
  CHECK(contains(error("data:;base64," + bytes.substr(0, 17)), "cannot be decoded"));
  CHECK(contains(error("data:" + bytes), "cannot be decoded"));
  CHECK(contains(error(std::string(5000, 'a')), "does not exist"));
  GltfFile none = GltfFile::square();
  none.json["buffers"] = {{{"byteLength", 60}}};
  CHECK(contains(gltf_mesh_error(none.json.dump(), "m.gltf"), "the buffer 0 has no bytes"));
}
