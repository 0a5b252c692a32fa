// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "io/image/image_codec.hpp"

namespace raysplats::io {

/// What the library raysplats-images and the program that loads it have to agree about: the headers
/// that declare the interface, by their digests (RAYSPLATS_IMAGES_HEADERS), so that functions in
/// another order are another interface too; and what the compiler and its library make of the types
/// that pass through. FNV-1a; every side computes its own.
constexpr std::uint64_t kImagesInterface = [] {
  std::uint64_t hash = 0xcbf29ce484222325u;
  const auto add = [&hash](std::uint64_t value) { hash = (hash ^ value) * 0x100000001b3u; };
  for (const char letter : std::string_view(RAYSPLATS_IMAGES_HEADERS)) {
    add(static_cast<std::uint64_t>(letter));
  }
  for (const std::size_t bytes :
       {sizeof(RawImage), sizeof(Image), sizeof(ImageEncoding), sizeof(ImageDecoder),
        sizeof(MovieEncoder), sizeof(PerceptualNetwork), sizeof(ImageCodec), sizeof(Error),
        sizeof(std::filesystem::path), sizeof(std::string)}) {
    add(bytes);
  }
  return hash;
}();

}  // namespace raysplats::io
