// SPDX-License-Identifier: Apache-2.0
// A model in a format other than PLY: the first byte says of which one. SPZ of versions 1 to 3 is
// compressed here, so that damage gets behind gzip's checksum.
#include <array>
#include <cstdlib>
#include <string>
#include <vector>

#include "fuzz/fuzz_target.hpp"
#include "io/compression.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 5> kNames{"packed.spz", "input.spz", "input.splat", "input.glb",
                                            "input.gltf"};

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size());
  std::filesystem::path path;
  if (choice == 0) {
    const std::vector<std::span<const std::byte>> parts{std::as_bytes(input)};
    const std::vector<std::byte> bytes = io::gzip(parts);
    path = scratch().write(kNames[choice],
                           {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  } else {
    path = scratch().write(kNames[choice], input);
  }
  const Gaussians model = read_model(path);
  for (const char* name : {"copy.ply", "copy.compressed.ply", "copy.spz", "copy.splat"}) {
    const std::filesystem::path copy = scratch().path() / name;
    write_model(copy, model);
    if (read_model(copy).size() != model.size()) std::abort();
  }
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
