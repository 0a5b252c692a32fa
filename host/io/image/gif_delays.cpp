// SPDX-License-Identifier: Apache-2.0
// The blocks of a GIF one after the other (GIF89a, appendix B).
#include "io/image/gif_delays.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdint>
#include <fstream>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr int kExtension = 0x21;
constexpr int kGraphicControl = 0xf9;
constexpr int kImage = 0x2c;
constexpr int kTrailer = 0x3b;
constexpr double kClock = 100.0;  // ticks a second

/// The bytes of the colours that a packed field announces.
std::streamsize colour_bytes(int packed) {
  return (packed & 0x80) != 0 ? std::streamsize{6} << (packed & 7) : 0;
}

void skip_parts(std::istream& file) {
  for (int size = file.get(); size > 0; size = file.get()) file.ignore(size);
}

/// Where the lengths of the frames are, up to the trailer; empty when that is missing.
std::vector<std::streamoff> places_of_lengths(std::istream& file, std::size_t& pictures) {
  std::vector<std::streamoff> places;
  file.ignore(10);
  const int packed = file.get();
  file.ignore(2 + colour_bytes(packed));
  while (file) {
    const int block = file.get();
    if (block == kTrailer) return places;
    if (block == kExtension) {
      // A size and a packed field come before the length.
      if (file.get() == kGraphicControl) places.push_back(std::streamoff{file.tellg()} + 2);
      skip_parts(file);
    } else if (block == kImage) {
      file.ignore(8);
      file.ignore(colour_bytes(file.get()) + 1);
      skip_parts(file);
      pictures += file ? 1 : 0;
    } else {
      break;
    }
  }
  return {};
}

}  // namespace

void set_gif_delays(const std::filesystem::path& path,
                    const std::filesystem::path& name,
                    std::size_t frames,
                    double fps) {
  std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
  std::size_t pictures = 0;
  const std::vector<std::streamoff> places = places_of_lengths(file, pictures);
  if (pictures != frames || places.size() != frames) {
    throw DataError(
        fmt::format("The video {} cannot be written: its file ends after {} of {} frames, as on a "
                    "full disk",
                    name.string(), pictures, frames));
  }
  const auto moment = [fps](std::size_t frame) {
    return std::llround(static_cast<double>(frame) * kClock / fps);
  };
  for (std::size_t i = 0; i < frames; ++i) {
    const auto ticks = static_cast<std::uint16_t>(moment(i + 1) - moment(i));
    file.seekp(places[i]);
    file.put(static_cast<char>(ticks & 0xff)).put(static_cast<char>(ticks >> 8));
  }
  file.flush();
  if (!file) throw DataError(fmt::format("The video {} cannot be written", name.string()));
}

}  // namespace raysplats::io
