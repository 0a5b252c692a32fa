// SPDX-License-Identifier: Apache-2.0
// A mesh: the first byte says of which format. Materials and buffers beside it are read from the
// same bytes, so that their readers are met too. The last three are meshes from memory.
#include <array>
#include <cstdlib>
#include <span>

#include "fuzz/fuzz_target.hpp"
#include "io/mesh/mesh_file.hpp"
#include "scene/mesh/mesh.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 4> kNames{"input.obj", "input.ply", "input.gltf", "input.glb"};
constexpr std::array kAlone{io::MeshFormat::kObj, io::MeshFormat::kPly, io::MeshFormat::kGltf};

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size() + kAlone.size());
  if (choice >= kNames.size()) {
    const auto bytes = std::as_bytes(input);
    const Mesh mesh = io::read_mesh_alone(kAlone[choice - kNames.size()],
                                          {bytes.begin(), bytes.end()}, "the mesh");
    validate(mesh, 1, "the mesh");
    if (mesh.triangle_count() > io::kMostAlone) std::abort();
    return;
  }
  scratch().write("input.mtl", input);
  scratch().write("input.bin", input);
  const io::MeshFile file = io::read_mesh(scratch().write(kNames[choice], input));
  validate(file.mesh, file.materials.size(), "the mesh");
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
