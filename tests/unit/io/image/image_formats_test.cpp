// SPDX-License-Identifier: Apache-2.0
// Formats of photos beyond PNG, JPEG and EXR, and names that files have for them.
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/photo_view.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// 16 x 8 pixels, red on the left and green on the right, of which the right ones may have half
/// alpha.
std::vector<std::uint8_t> two_colors(bool alpha) {
  std::vector<std::uint8_t> numbers;
  for (int i = 0; i < 128; ++i) {
    const bool left = i % 16 < 8;
    const auto add = [&](int value) { numbers.push_back(static_cast<std::uint8_t>(value)); };
    add(left ? 200 : 0);
    add(left ? 0 : 100);
    add(0);
    if (alpha) add(left ? 255 : 128);
  }
  // OpenImageIO 2.4 reads rows as long as those of libheif, whatever the width, to write HEIF.
  numbers.resize(numbers.size() + 256);
  return numbers;
}

/// Whether OpenImageIO can write the picture here.
bool write_two_colors(const fs::path& path, const char* format, bool alpha) {
  const auto output = OIIO::ImageOutput::create(format);
  if (!output) return false;
  OIIO::ImageSpec spec(16, 8, alpha ? 4 : 3, OIIO::TypeUInt8);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  return output->open(path.string(), spec) &&
         output->write_image(OIIO::TypeUInt8, two_colors(alpha).data()) && output->close();
}

void check_photo(const fs::path& path, bool alpha, double tolerance) {
  CAPTURE(path.string());
  CHECK(io::image_size(path).sample_bytes == 1);
  const Image photo = load_view_image(view_of(path));
  REQUIRE(photo.width == 16);
  REQUIRE(photo.height == 8);
  const auto near = [&](int x, int c, double byte) {
    CHECK(std::abs(static_cast<double>(photo.at(x, 3, c)) - byte / 255) <= tolerance);
  };
  near(2, 0, 200);
  near(2, 1, 0);
  near(2, 3, 255);
  near(13, 0, 0);
  near(13, 1, 100);
  near(13, 3, alpha ? 128 : 255);
}

std::string refusal(const fs::path& path, const std::string& bytes) {
  write_bytes(path, bytes);
  const std::string message = data_error([&] { read_image(path); });
  CHECK(contains(message, path.string()));
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

}  // namespace

TEST_CASE("photos may be GIF, TGA, HEIF or AVIF, and be called as Windows calls them") {
  const Scratch scratch;
  struct Case {
    const char* name;
    const char* format;
    bool alpha;
    double tolerance;
  };
  for (const Case& file : {Case{"a.gif", "gif", false, 0.02}, Case{"b.tga", "targa", false, 0.001},
                           Case{"c.TGA", "targa", true, 0.001}, Case{"d.jfif", "jpeg", false, 0.05},
                           Case{"e.BMP", "bmp", false, 0.001}, Case{"f.heic", "heif", false, 0.05},
                           Case{"g.heif", "heif", true, 0.05}}) {
    if (!write_two_colors(scratch / file.name, file.format, file.alpha)) {
      MESSAGE("OpenImageIO cannot write ", file.format, " here");
      continue;
    }
    check_photo(scratch / file.name, file.alpha, file.tolerance);
  }
}

TEST_CASE("a fourth number that the format does not use is no alpha where it is 0 everywhere") {
  const Scratch scratch;
  const auto channels = [&](const char* name, const std::string& bytes) {
    write_bytes(scratch / name, bytes);
    const Image image = read_image(scratch / name);
    REQUIRE(image.width == 2);
    for (std::size_t c = 0; c < 3; ++c) {
      const auto stride = static_cast<std::size_t>(image.channels);
      CHECK(255 * image.data[stride + c] == doctest::Approx(60.0 - 10.0 * static_cast<double>(c)));
    }
    return image.channels;
  };
  const auto pixels = [](int alpha) {
    std::string out("\x0a\x14\x1e\0\x28\x32\x3c\0", 8);  // blue, green, red
    out[7] = static_cast<char>(alpha);
    return out;
  };
  // The header of Windows 3 has 40 bytes, those since with a mask of alpha 108 or 124.
  const auto bmp = [&](std::uint32_t header, std::uint32_t mask, int alpha) {
    std::string bytes = "BM";
    for (const std::uint32_t number : {22 + header, 0u, 14 + header, header, 2u, 1u})
      put(bytes, number);
    put<std::uint16_t>(bytes, 1);
    put<std::uint16_t>(bytes, 32);
    put<std::uint32_t>(bytes, header > 40 ? 3 : 0);
    for (const std::uint32_t number : {8u, 0u, 0u, 0u, 0u}) put(bytes, number);
    for (const std::uint32_t number : {0xff0000u, 0xff00u, 0xffu, mask}) put(bytes, number);
    bytes.resize(14 + header);
    return bytes + pixels(alpha);
  };
  CHECK(channels("a.bmp", bmp(40, 0, 0)) == 3);
  CHECK(channels("a.bmp", bmp(40, 0, 7)) == 4);
  CHECK(channels("a.bmp", bmp(124, 0, 0)) == 3);
  CHECK(channels("a.bmp", bmp(124, 0xff000000u, 0)) == 4);
  const auto targa = [&](int alpha_bits, int alpha) {
    std::string header(18, '\0');
    header[2] = 2;
    header[12] = 2;
    header[14] = 1;
    header[16] = 32;
    header[17] = static_cast<char>(0x20 + alpha_bits);
    return header + pixels(alpha);
  };
  CHECK(channels("a.tga", targa(0, 0)) == 3);
  CHECK(channels("a.tga", targa(0, 7)) == 4);
  CHECK(channels("a.tga", targa(8, 0)) == 4);
}

TEST_CASE("files that only begin as such pictures are refused in one sentence") {
  const Scratch scratch;
  CHECK(!refusal(scratch / "a.gif", "GIF89a").empty());
  CHECK(contains(refusal(scratch / "a.tga", "hello, this is no picture at all"), "does not start"));
  CHECK(contains(refusal(scratch / "b.tga", "short"), "does not start"));
  std::string targa(18, '\0');
  targa[2] = 2;
  targa[12] = targa[14] = 4;
  targa[16] = 24;
  CHECK(!refusal(scratch / "c.tga", targa).empty());
  CHECK(!refusal(scratch / "a.heic", std::string("\0\0\0\x18", 4) + "ftypheic").empty());
  // A video.
  CHECK(contains(refusal(scratch / "b.heic", std::string("\0\0\0\x18", 4) + "ftypisom"),
                 "does not start"));
  CHECK(contains(data_error([&] {
                   write_bytes(scratch / "a.cr2", "II*");
                   read_image(scratch / "a.cr2");
                 }),
                 "GIF"));
}

TEST_CASE("a TIFF in L*a*b* is refused by name, not read as colours") {
  const Scratch scratch;
  // One pixel; entries by tag, type (3: 16 bits), count and value (TIFF 6.0, section 2).
  const std::vector<std::array<std::uint32_t, 4>> entries{
      {256, 3, 1, 1}, {257, 3, 1, 1}, {258, 3, 1, 8}, {259, 3, 1, 1}, {262, 3, 1, 8},
      {273, 4, 1, 8}, {277, 3, 1, 3}, {278, 3, 1, 1}, {279, 4, 1, 3}, {284, 3, 1, 1}};
  std::string bytes("II*\0\x0c\0\0\0\x80\x05\x07\0", 12);
  put<std::uint16_t>(bytes, static_cast<std::uint16_t>(entries.size()));
  for (const auto& entry : entries) {
    put<std::uint16_t>(bytes, static_cast<std::uint16_t>(entry[0]));
    put<std::uint16_t>(bytes, static_cast<std::uint16_t>(entry[1]));
    put(bytes, entry[2]);
    put(bytes, entry[3]);
  }
  put<std::uint32_t>(bytes, 0);
  CHECK(contains(refusal(scratch / "a.tif", bytes), "CIELAB colours"));
}
