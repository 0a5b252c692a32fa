// SPDX-License-Identifier: Apache-2.0
// TIFF files as other programs write them: the directory before the pixels, which may end early.
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>
#include <zlib.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/photo/depth_map.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

enum Compression : std::uint32_t { kNone = 1, kDeflate = 8, kPackBits = 32773 };

std::string compressed(const std::string& strip, Compression compression) {
  std::string out = strip;
  if (compression == kDeflate) {
    uLongf size = ::compressBound(strip.size());
    out.resize(size);
    REQUIRE(::compress(reinterpret_cast<Bytef*>(out.data()), &size,
                       reinterpret_cast<const Bytef*>(strip.data()), strip.size()) == Z_OK);
    out.resize(size);
  } else if (compression == kPackBits) {
    // Runs of literal bytes (TIFF 6.0, section 9).
    constexpr std::size_t kRun = 16;
    out.clear();
    for (std::size_t i = 0; i < strip.size(); i += kRun)
      out += static_cast<char>(kRun - 1) + strip.substr(i, kRun);
  }
  return out;
}

struct Layout {
  std::uint32_t width = 1, height = 1;
  std::uint32_t bits = 8, format = 1;  ///< of a number; 1 is unsigned, 2 signed
  Compression compression = kNone;
  std::uint32_t strips = 1;
};

/// One channel; entries by tag, type (3: 16 bits, 4: 32 bits), count and value (TIFF 6.0, section
/// 2).
std::string tiff(const std::string& pixels, const Layout& layout) {
  std::vector<std::string> strips;
  const std::size_t share = pixels.size() / layout.strips;
  for (std::size_t i = 0; i < layout.strips; ++i)
    strips.push_back(compressed(pixels.substr(i * share, share), layout.compression));
  constexpr std::uint32_t kEntries = 10, kEnd = 8 + 2 + 12 * kEntries + 4;
  const std::uint32_t lists = layout.strips > 1 ? 4 * layout.strips : 0;
  std::string offsets, counts, data;
  for (const std::string& strip : strips) {
    put(offsets, static_cast<std::uint32_t>(kEnd + 2 * lists + data.size()));
    put(counts, static_cast<std::uint32_t>(strip.size()));
    data += strip;
  }
  const auto first = [&](const std::string& list, std::uint32_t at) {
    std::uint32_t value = at;
    if (layout.strips == 1) std::memcpy(&value, list.data(), sizeof(value));
    return value;
  };
  const std::array<std::array<std::uint32_t, 4>, kEntries> entries{
      {{256, 4, 1, layout.width},
       {257, 4, 1, layout.height},
       {258, 3, 1, layout.bits},
       {259, 3, 1, layout.compression},
       {262, 3, 1, 1},
       {273, 4, layout.strips, first(offsets, kEnd)},
       {277, 3, 1, 1},
       {278, 4, 1, layout.height / layout.strips},
       {279, 4, layout.strips, first(counts, kEnd + lists)},
       {339, 3, 1, layout.format}}};
  std::string bytes("II*\0\x08\0\0\0", 8);
  put(bytes, static_cast<std::uint16_t>(kEntries));
  for (const auto& entry : entries) {
    put(bytes, static_cast<std::uint16_t>(entry[0]));
    put(bytes, static_cast<std::uint16_t>(entry[1]));
    put(bytes, entry[2]);
    put(bytes, entry[3]);
  }
  put<std::uint32_t>(bytes, 0);
  return bytes + (lists > 0 ? offsets + counts : "") + data;
}

template <class T>
fs::path write_row(const fs::path& path, std::uint32_t format, const std::vector<T>& numbers) {
  std::string pixels;
  for (const T number : numbers) put(pixels, number);
  Layout layout;
  layout.width = static_cast<std::uint32_t>(numbers.size());
  layout.bits = 8 * sizeof(T);
  layout.format = format;
  write_bytes(path, tiff(pixels, layout));
  return path;
}

}  // namespace

TEST_CASE("a TIFF that ends within its pixels is refused, however they are stored") {
  const Scratch scratch;
  const fs::path path = scratch / "a.tif";
  CounterRng rng(8, 1);
  std::string pixels(64 * 64, '\0');
  for (char& pixel : pixels) pixel = static_cast<char>(rng.below(256));
  for (const Compression compression : {kNone, kDeflate, kPackBits}) {
    for (const std::uint32_t strips : {1u, 4u, 64u}) {
      CAPTURE(compression);
      CAPTURE(strips);
      const std::string whole = tiff(pixels, {64, 64, 8, 1, compression, strips});
      write_bytes(path, whole);
      const io::RawImage image = io::read_raw_image(path);
      const auto& numbers = std::get<std::vector<std::uint8_t>>(image.numbers);
      CHECK(std::string(numbers.begin(), numbers.end()) == pixels);
      for (const double share : {0.5, 0.8, 0.99}) {
        write_bytes(
            path,
            whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
        const std::string message = data_error([&] { io::read_raw_image(path); });
        CHECK(contains(message, path.string()));
        CHECK(contains(message, "copy it again if it is truncated or damaged"));
      }
    }
  }
}

TEST_CASE("a TIFF of JPEG that ends within its pixels is refused") {
  const Scratch scratch;
  const fs::path path = scratch / "a.tif";
  std::vector<std::uint8_t> pixels;
  for (std::size_t i = 0; i < 256 * 256 * 3; ++i)
    pixels.push_back(static_cast<std::uint8_t>(i / 768));
  OIIO::ImageSpec spec(256, 256, 3, OIIO::TypeUInt8);
  spec.attribute("Compression", "jpeg:80");
  spec.attribute("tiff:RowsPerStrip", 64);
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(OIIO::TypeUInt8, pixels.data()));
  REQUIRE(output->close());
  CHECK(read_image(path).width == 256);
  const std::string whole = read_bytes(path);
  for (const std::size_t percent : {5u, 50u, 80u, 99u}) {
    CAPTURE(percent);
    write_bytes(path, whole.substr(0, percent * whole.size() / 100));
    CHECK(contains(data_error([&] { read_image(path); }), path.string()));
  }
}

TEST_CASE("a TIFF of planes, one after the other, is read") {
  const Scratch scratch;
  const fs::path path = scratch / "a.tif";
  constexpr int kSide = 64;
  std::vector<std::uint8_t> pixels(kSide * kSide * 3);
  CounterRng rng(8, 2);
  for (std::uint8_t& number : pixels) number = static_cast<std::uint8_t>(rng.below(256));
  for (const char* compression : {"none", "zip", "lzw"}) {
    CAPTURE(compression);
    OIIO::ImageSpec spec(kSide, kSide, 3, OIIO::TypeUInt8);
    spec.attribute("Compression", compression);
    spec.attribute("tiff:RowsPerStrip", 16);
    spec.attribute("planarconfig", "separate");
    const auto output = OIIO::ImageOutput::create(path.string());
    REQUIRE(output);
    REQUIRE(output->open(path.string(), spec));
    REQUIRE(output->write_image(OIIO::TypeUInt8, pixels.data()));
    REQUIRE(output->close());
    CHECK(std::get<std::vector<std::uint8_t>>(io::read_raw_image(path).numbers) == pixels);
  }
}

TEST_CASE("a TIFF with a strip that zlib cannot unpack is refused") {
  const Scratch scratch;
  for (const std::uint32_t strips : {1u, 4u, 64u}) {
    CAPTURE(strips);
    std::string bytes = tiff(std::string(64 * 64, 'a'), {64, 64, 8, 1, kDeflate, strips});
    bytes[bytes.rfind("\x78\x9c")] = 0;  // how the last one begins
    write_bytes(scratch / "a.tif", bytes);
    CHECK(contains(data_error([&] { read_image(scratch / "a.tif"); }), "truncated or damaged"));
  }
}

TEST_CASE("depths in integers of any width are taken as they are") {
  const Scratch scratch;
  const auto depths = [](const fs::path& path) { return io::read_depth_map(path, 0.5).values; };
  const std::vector<float> expected{500.0f, 1.5f, 0.0f, 16383.0f};
  CHECK(depths(write_row<std::int16_t>(scratch / "a.tif", 2, {1000, 3, -1, 32766})) == expected);
  CHECK(depths(write_row<std::uint16_t>(scratch / "b.tif", 1, {1000, 3, 0, 32766})) == expected);
  CHECK(depths(write_row<std::int32_t>(scratch / "c.tif", 2, {1000, 3, -7, 32766})) == expected);
  CHECK(depths(write_row<std::uint32_t>(scratch / "d.tif", 1, {1000, 3, 0, 32766})) == expected);
  CHECK(depths(write_row<float>(scratch / "e.tif", 3, {1000, 3, -1, 32766})) == expected);
}
