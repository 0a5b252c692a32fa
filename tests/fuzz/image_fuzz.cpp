// SPDX-License-Identifier: Apache-2.0
// An image of any format. The first byte asks for right checksums in the chunks of a PNG, which
// chance would never find.
#include <vector>

#include "fuzz/fuzz_target.hpp"
#include "io/image/image_file.hpp"
#include "raysplats/io.hpp"

namespace raysplats::fuzz {
namespace {

std::uint32_t big_endian(const std::uint8_t* p) {
  return static_cast<std::uint32_t>(p[0]) << 24 | static_cast<std::uint32_t>(p[1]) << 16 |
         static_cast<std::uint32_t>(p[2]) << 8 | p[3];
}

// The checksum of a chunk (PNG specification, annex D), bit by bit.
std::uint32_t png_crc(std::span<const std::uint8_t> bytes) {
  std::uint32_t crc = 0xffffffffu;
  for (const std::uint8_t byte : bytes) {
    crc ^= byte;
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
  }
  return crc ^ 0xffffffffu;
}

void repair_png(std::vector<std::uint8_t>& bytes) {
  constexpr std::size_t kSignature = 8;
  constexpr std::size_t kAroundData = 12;
  std::size_t at = kSignature;
  while (at + kAroundData <= bytes.size()) {
    const std::size_t length = big_endian(&bytes[at]);
    if (length > bytes.size() - at - kAroundData) return;
    const std::uint32_t crc = png_crc({&bytes[at + 4], length + 4});
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[at + 8 + length + i] = static_cast<std::uint8_t>(crc >> (24 - 8 * i));
    }
    at += length + kAroundData;
  }
}

void parse(std::span<const std::uint8_t> input) {
  const bool repair = take_choice(input, 2) == 1;
  std::vector<std::uint8_t> bytes(input.begin(), input.end());
  if (repair) repair_png(bytes);
  const std::filesystem::path path = scratch().write("input.png", bytes);
  // The picture itself is bounded by the reader at 2^28 pixels; a fuzzer has less memory.
  const io::ImageSize size = io::image_size(path);
  if (static_cast<std::int64_t>(size.width) * size.height > (1 << 20)) return;
  read_image(path);
}

}  // namespace
}  // namespace raysplats::fuzz

RS_FUZZ_TARGET(raysplats::fuzz::parse)
