// SPDX-License-Identifier: Apache-2.0
#include "io/model/spz_axes.hpp"

#include <fmt/format.h>

#include <array>
#include <string_view>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::uint32_t kAxesRecord = 0xadbe0003;
constexpr std::uint32_t kAxesBytes = 4;
constexpr std::size_t kRecordHead = 8;

/// Where x, y and z point: left or right, up or down, front or back. The last eight are the first
/// after a quarter turn about x.
constexpr std::array<std::string_view, 17> kAxes{"",    "LDB", "RDB", "LUB", "RUB", "LDF",
                                                 "RDF", "LUF", "RUF", "LFD", "RFD", "LFU",
                                                 "RFU", "LBD", "RBD", "LBU", "RBU"};

/// An axis of the PLY, x right, y down, z front.
struct Direction {
  char letter;
  const char* word;
  glm::dvec3 in_ply;
};
constexpr std::array<Direction, 6> kDirections{{{'L', "left", {-1, 0, 0}},
                                                {'R', "right", {1, 0, 0}},
                                                {'U', "up", {0, -1, 0}},
                                                {'D', "down", {0, 1, 0}},
                                                {'B', "back", {0, 0, -1}},
                                                {'F', "front", {0, 0, 1}}}};

const Direction& direction(std::uint32_t axes, std::size_t axis) {
  std::size_t i = 0;
  while (kDirections[i].letter != kAxes.at(axes)[axis]) ++i;
  return kDirections[i];
}

}  // namespace

std::optional<std::uint32_t> declared_spz_axes(std::span<const std::byte> records,
                                               const std::filesystem::path& path) {
  ByteReader reader(records, path);
  while (reader.remaining() >= kRecordHead) {
    const auto type = reader.read<std::uint32_t>("the kind of a record");
    const auto bytes = reader.read<std::uint32_t>("the length of a record");
    if (bytes > reader.remaining()) break;
    if (type != kAxesRecord) {
      reader.skip(bytes, "a record");
      continue;
    }
    const std::uint32_t axes = bytes < kAxesBytes ? 0 : reader.read<std::uint32_t>("the axes");
    if (bytes < kAxesBytes || axes >= kAxes.size()) {
      throw DataError(fmt::format(
          "{} is no valid SPZ file: it declares its axes by {}, but 4 bytes with a number from 0 "
          "to {} are known",
          path.string(), bytes < kAxesBytes ? fmt::format("{} bytes", bytes) : fmt::to_string(axes),
          kAxes.size() - 1));
    }
    return axes == 0 ? std::nullopt : std::optional(axes);
  }
  return std::nullopt;
}

std::vector<std::byte> spz_axes_record(std::uint32_t axes) {
  std::vector<std::byte> out;
  for (const std::uint32_t word : {kAxesRecord, kAxesBytes, axes}) {
    for (std::uint32_t shift = 0; shift < 32; shift += 8)
      out.push_back(static_cast<std::byte>(word >> shift & 0xff));
  }
  return out;
}

std::string spz_axes_name(std::uint32_t axes) {
  return fmt::format("x {}, y {}, z {}", direction(axes, 0).word, direction(axes, 1).word,
                     direction(axes, 2).word);
}

glm::dmat4 spz_axes_turn(std::uint32_t axes) {
  glm::dmat4 turn(1.0);
  for (std::size_t axis = 0; axis < 3; ++axis)
    turn[static_cast<int>(axis)] = glm::dvec4(direction(axes, axis).in_ply, 0.0);
  return turn;
}

}  // namespace raysplats::io
