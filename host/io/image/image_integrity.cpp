// SPDX-License-Identifier: Apache-2.0
#include "io/image/image_integrity.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

namespace raysplats::io {
namespace {

constexpr std::size_t kSignatureBytes = 8;  // of a PNG

constexpr std::array<std::uint32_t, 256> crc_table() {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1u) != 0 ? 0xedb88320u : 0u);
    table[i] = value;
  }
  return table;
}

}  // namespace

bool is_whole_jpeg(std::span<const std::byte> bytes) {
  const auto byte_at = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
  std::size_t i = 2;
  while (i + 1 < bytes.size()) {
    if (byte_at(i) != 0xff) {
      ++i;  // entropy-coded data
      continue;
    }
    const unsigned marker = byte_at(i + 1);
    if (marker == 0xd9) return true;
    if (marker == 0xff) {
      ++i;  // fill byte
    } else if (marker == 0x00 || marker == 0x01 || (marker >= 0xd0 && marker <= 0xd8)) {
      i += 2;  // stuffed byte or a marker without a segment
    } else {
      if (i + 3 >= bytes.size()) return false;
      i += 2 + (byte_at(i + 2) << 8 | byte_at(i + 3));
    }
  }
  return false;
}

bool has_whole_png_chunks(std::string_view bytes, bool header_only) {
  static constexpr std::array<std::uint32_t, 256> kTable = crc_table();
  const auto big_endian = [&](std::size_t i) {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k)
      value = value << 8 | static_cast<std::uint8_t>(bytes[i + k]);
    return value;
  };
  std::size_t i = kSignatureBytes;
  constexpr std::size_t kAroundData = 12;  // length, type and checksum
  while (bytes.size() - i >= kAroundData) {
    const std::size_t length = big_endian(i);
    if (length > bytes.size() - i - kAroundData) return false;
    const std::string_view checked = bytes.substr(i + 4, length + 4);
    std::uint32_t crc = 0xffffffffu;
    for (const char c : checked)
      crc = kTable[(crc ^ static_cast<std::uint8_t>(c)) & 0xffu] ^ (crc >> 8);
    if ((crc ^ 0xffffffffu) != big_endian(i + 8 + length)) return false;
    if (header_only) return checked.starts_with("IHDR");
    if (checked.starts_with("IEND")) return true;
    i += length + kAroundData;
  }
  return false;
}

bool has_whole_jpeg_strips(std::istream& file) {
  const bool little = file.get() == 'I';
  // The stream fails for good at what lies beyond the end.
  const auto number = [&](std::uint64_t at, std::uint64_t bytes) {
    std::array<char, 8> raw{};
    file.seekg(static_cast<std::streamoff>(at));
    file.read(raw.data(), static_cast<std::streamsize>(bytes));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < bytes; ++i)
      value = value << 8 | static_cast<std::uint8_t>(raw[little ? bytes - 1 - i : i]);
    return value;
  };
  const bool big = number(2, 2) == 43;
  const std::uint64_t word = big ? 8 : 4, counter = big ? 8 : 2;
  const std::uint64_t directory = number(word, word), entries = number(directory, counter);
  struct List {
    std::uint64_t at = 0, count = 0, width = 0;
  };
  List offsets, sizes;
  bool jpeg = false;
  for (std::uint64_t i = 0; file && i < entries; ++i) {
    const std::uint64_t entry = directory + counter + i * (4 + 2 * word), value = entry + 4 + word;
    const std::uint64_t tag = number(entry, 2), type = number(entry + 2, 2);
    List list{value, number(entry + 4, word), type == 3 ? 2u : type == 16 ? 8u : 4u};
    if (list.count > word / list.width) list.at = number(value, word);
    if (tag == 259) jpeg = number(value, 2) == 7;
    if (tag == 273 || tag == 324) offsets = list;
    if (tag == 279 || tag == 325) sizes = list;
  }
  if (!jpeg) return true;
  for (std::uint64_t i = 0; file && i < std::min(offsets.count, sizes.count); ++i) {
    const std::uint64_t size = number(sizes.at + i * sizes.width, sizes.width);
    const std::uint64_t end = number(offsets.at + i * offsets.width, offsets.width) + size;
    if (size > 0) number(end - 1, 1);
  }
  return static_cast<bool>(file);
}

}  // namespace raysplats::io
