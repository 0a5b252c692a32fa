// SPDX-License-Identifier: Apache-2.0
// A model in a format other than PLY: the first byte says of which one. SPZ of versions 1 to 3 is
// compressed here and the files of a SOG are put into their archive, so that damage gets behind the
// checksums.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "fuzz/fuzz_target.hpp"
#include "io/compression.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 7> kNames{"packed.spz", "input.spz",  "input.splat", "input.glb",
                                            "input.gltf", "packed.sog", "input.sog"};
constexpr std::array<const char*, 8> kSogFiles{
    "meta.json",  "means_l.webp", "means_u.webp",       "scales.webp",
    "quats.webp", "sh0.webp",     "shN_centroids.webp", "shN_labels.webp"};

/// The files of a SOG, each behind two bytes that say how long it is.
std::vector<std::byte> archive_of(std::span<const std::uint8_t> input) {
  std::vector<std::pair<std::string, std::vector<std::byte>>> files;
  for (const char* name : kSogFiles) {
    if (input.size() < 2) break;
    const std::size_t size = std::min<std::size_t>(input[0] | input[1] << 8, input.size() - 2);
    const auto bytes = std::as_bytes(input.subspan(2, size));
    files.emplace_back(name, std::vector<std::byte>(bytes.begin(), bytes.end()));
    input = input.subspan(2 + size);
  }
  return io::zip_of(files, kNames[5]);
}

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size());
  std::filesystem::path path;
  if (choice == 0 || choice == 5) {
    const std::vector<std::span<const std::byte>> parts{std::as_bytes(input)};
    const std::vector<std::byte> bytes = choice == 0 ? io::gzip(parts) : archive_of(input);
    path = scratch().write(kNames[choice],
                           {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
  } else {
    path = scratch().write(kNames[choice], input);
  }
  const Gaussians model = read_model(path);
  for (const char* name :
       {"copy.ply", "copy.compressed.ply", "copy.spz", "copy.splat", "copy.sog"}) {
    const std::filesystem::path copy = scratch().path() / name;
    write_model(copy, model);
    if (read_model(copy).size() != model.size()) std::abort();
  }
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
