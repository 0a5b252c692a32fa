// SPDX-License-Identifier: Apache-2.0
// A mesh: the first byte says of which format. Materials and buffers beside it are read from the
// same bytes, so that their readers are met too.
#include <array>
#include <string>

#include "core/mesh.hpp"
#include "fuzz/fuzz_target.hpp"
#include "io/mesh_file.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 4> kNames{"input.obj", "input.ply", "input.gltf", "input.glb"};

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size());
  scratch().write("input.mtl", input);
  scratch().write("input.bin", input);
  const io::MeshFile file = io::read_mesh(scratch().write(kNames[choice], input));
  validate(file.mesh, file.materials.size(), "the mesh");
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
