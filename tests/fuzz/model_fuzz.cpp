// SPDX-License-Identifier: Apache-2.0
// A model in a format other than PLY: the first byte says of which one. SPZ of versions 1 to 3 is
// compressed here and the files of a SOG are put into their archive, stored and deflated, or into a
// folder, so that damage gets behind the checksums.
#include <algorithm>
#include <array>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

#include "deflated_zip.hpp"
#include "fuzz/fuzz_target.hpp"
#include "io/compression.hpp"
#include "io/zip_archive.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

constexpr std::array<const char*, 9> kNames{"packed.spz", "input.spz",    "input.splat",
                                            "input.glb",  "input.gltf",   "packed.sog",
                                            "input.sog",  "deflated.sog", "meta.json"};
constexpr std::array<const char*, 8> kSogFiles{
    "meta.json",  "means_l.webp", "means_u.webp",       "scales.webp",
    "quats.webp", "sh0.webp",     "shN_centroids.webp", "shN_labels.webp"};

using Files = std::vector<std::pair<std::string, std::vector<std::byte>>>;

std::span<const std::uint8_t> as_input(const std::vector<std::byte>& bytes) {
  return {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()};
}

/// The files of a SOG, each behind two bytes that say how long it is.
Files sog_files(std::span<const std::uint8_t> input) {
  Files files;
  for (const char* name : kSogFiles) {
    if (input.size() < 2) break;
    const std::size_t size = std::min<std::size_t>(input[0] | input[1] << 8, input.size() - 2);
    const auto bytes = std::as_bytes(input.subspan(2, size));
    files.emplace_back(name, std::vector<std::byte>(bytes.begin(), bytes.end()));
    input = input.subspan(2 + size);
  }
  return files;
}

std::filesystem::path write_input(std::size_t choice, std::span<const std::uint8_t> input) {
  const std::string name = kNames[choice];
  if (name == "packed.spz") {
    const std::vector<std::span<const std::byte>> parts{std::as_bytes(input)};
    return scratch().write(name, as_input(io::gzip(parts)));
  }
  if (name == "packed.sog")
    return scratch().write(name, as_input(io::zip_of(sog_files(input), name)));
  if (name == "deflated.sog")
    return scratch().write(name, as_input(test::deflated_zip(sog_files(input))));
  if (name == "meta.json") {
    // Those of the input before may not stand in for what this one lacks.
    for (const char* file : kSogFiles) std::filesystem::remove(scratch().path() / file);
    for (const auto& [file, bytes] : sog_files(input)) scratch().write(file, as_input(bytes));
    return scratch().path() / name;
  }
  return scratch().write(name, input);
}

void parse(std::span<const std::uint8_t> input) {
  const std::size_t choice = take_choice(input, kNames.size());
  const std::filesystem::path path = write_input(choice, input);
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
