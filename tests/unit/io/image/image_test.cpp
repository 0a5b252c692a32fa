// SPDX-License-Identifier: Apache-2.0
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <csignal>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/image/image_header.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// Smooth in x and y, so that JPEG keeps it; every channel differs.
Image gradient(int width, int height, int channels) {
  Image image(width, height, channels);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < channels; ++c) {
        image.at(x, y, c) =
            static_cast<float>((x + 0.5) / width * (c + 1) / channels * 0.7 + 0.3 * y / height);
      }
    }
  }
  return image;
}

double largest_difference(const Image& a, const Image& b) {
  REQUIRE(a.width == b.width);
  REQUIRE(a.height == b.height);
  REQUIRE(a.channels == b.channels);
  double worst = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) {
    worst =
        std::max(worst, std::abs(static_cast<double>(a.data[i]) - static_cast<double>(b.data[i])));
  }
  return worst;
}

/// Writes a file of any format and type with OpenImageIO itself.
void write_raw(const fs::path& path,
               int channels,
               const OIIO::TypeDesc& type,
               const void* data,
               int width,
               int height) {
  auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(width, height, channels, type);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(type, data));
  REQUIRE(output->close());
}

std::string read_error(const fs::path& path) {
  std::string message = data_error([&] { read_image(path); });
  INFO(message);
  CHECK(contains(message, path.filename().string()));
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

}  // namespace

TEST_CASE("PNG keeps every 8-bit value, straight alpha included, for 1 to 4 channels") {
  const Scratch scratch;
  for (int channels = 1; channels <= 4; ++channels) {
    Image image(16, 16, channels);
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      image.data[i] = static_cast<float>((i * 37) % 256) / 255.0f;
    }
    write_image(scratch / "a.png", image);
    CHECK(largest_difference(read_image(scratch / "a.png"), image) < 1e-7);
  }
}

TEST_CASE("8-bit formats clamp and round, and NaN is black") {
  const Scratch scratch;
  Image image(4, 1, 1);
  image.data = {-1.0f, 7.0f, 100.4f / 255.0f, std::nanf("")};
  write_image(scratch / "a.png", image);
  const Image read = read_image(scratch / "a.png");
  CHECK(read.data[0] == 0.0f);
  CHECK(read.data[1] == 1.0f);
  CHECK(read.data[2] == doctest::Approx(100.0 / 255.0));
  CHECK(read.data[3] == 0.0f);
}

TEST_CASE("EXR is exact for any float and names its channels") {
  const Scratch scratch;
  Image image = gradient(7, 5, 5);
  image.data[3] = -12345.678f;
  image.data[9] = 1e-30f;
  write_image(scratch / "a.exr", image, {"Z"}, ColorSpace::kLinear);
  auto input = OIIO::ImageInput::open((scratch / "a.exr").string());
  REQUIRE(input);
  CHECK(input->spec().channelnames == std::vector<std::string>{"R", "G", "B", "A", "Z"});
  CHECK(input->spec().format == OIIO::TypeFloat);
  CHECK(input->spec().get_string_attribute("oiio:ColorSpace") == "Linear");
  CHECK(input->spec().find_attribute("chromaticities") != nullptr);
  std::vector<float> all(7 * 5 * 5);
  REQUIRE(input->read_image(0, 0, 0, 5, OIIO::TypeFloat, all.data()));
  CHECK(all == image.data);
  const Image colors = read_image(scratch / "a.exr");
  CHECK(colors.channels == 4);
  CHECK(colors.at(6, 4, 3) == image.at(6, 4, 3));
  write_image(scratch / "b.exr", gradient(3, 2, 3), {}, ColorSpace::kDisplay);
  input = OIIO::ImageInput::open((scratch / "b.exr").string());
  REQUIRE(input);
  CHECK(input->spec().get_string_attribute("oiio:ColorSpace") == "sRGB");
}

TEST_CASE("EXR of other programs is read in every compression, as halves, in tiles and windows") {
  const Scratch scratch;
  const Image image = gradient(50, 37, 4);
  const fs::path path = scratch / "a.exr";
  const auto write = [&](const OIIO::ImageSpec& spec) {
    const auto output = OIIO::ImageOutput::create(path.string());
    REQUIRE(output);
    REQUIRE(output->open(path.string(), spec));
    REQUIRE(output->write_image(OIIO::TypeFloat, image.data.data()));
    REQUIRE(output->close());
  };
  for (const char* compression : {"none", "rle", "zip", "zips", "piz", "pxr24", "b44", "dwaa"}) {
    for (const OIIO::TypeDesc& type : {OIIO::TypeFloat, OIIO::TypeHalf}) {
      for (const int tile : {0, 16}) {
        CAPTURE(compression);
        CAPTURE(tile);
        OIIO::ImageSpec spec(image.width, image.height, 4, type);
        spec.attribute("compression", compression);
        spec.tile_width = spec.tile_height = tile;
        write(spec);
        CHECK(io::image_size(path).width == 50);
        CHECK(io::image_size(path).height == 37);
        const bool lossy = std::string(compression) == "b44" || std::string(compression) == "dwaa";
        CHECK(largest_difference(read_image(path), image) < (lossy ? 0.03 : 1e-3));
      }
    }
  }
  // What a renderer drew of a larger picture.
  OIIO::ImageSpec window(image.width, image.height, 4, OIIO::TypeFloat);
  window.x = -7, window.y = 11;
  window.full_width = 100, window.full_height = 90;
  write(window);
  Image whole(100, 90, 4);
  for (int y = 11; y < 11 + image.height; ++y) {
    for (int x = 0; x < image.width - 7; ++x) {
      for (int c = 0; c < 4; ++c) whole.at(x, y, c) = image.at(x + 7, y - 11, c);
    }
  }
  CHECK(largest_difference(read_image(path), whole) == 0.0);
  // Channels that are no colours are left out where there are colours.
  OIIO::ImageSpec mixed(image.width, image.height, 4, OIIO::TypeFloat);
  mixed.channelnames = {"Z", "R", "G", "B"};
  write(mixed);
  const Image colors = read_image(path);
  CHECK(colors.channels == 3);
  CHECK(colors.at(20, 10, 2) == image.at(20, 10, 3));
}

TEST_CASE("the size of a PNG or JPEG is read from its header as the library reads it") {
  const Scratch scratch;
  for (const auto& [width, height] : {std::pair(1, 1), {300, 7}, {2, 513}}) {
    for (const char* name : {"a.png", "a.jpg"}) {
      write_image(scratch / name, gradient(width, height, 3));
      const auto size = io::size_in_header(scratch / name, name[2] == 'p' ? "png" : "jpeg");
      REQUIRE(size);
      CHECK(size->width == width);
      CHECK(size->height == height);
    }
  }
  // A segment that holds what looks like the beginning of a frame, and fill bytes.
  const std::string jpeg = read_bytes(scratch / "a.jpg");
  const std::string segment("\xff\xff\xe1\0\x0a\xff\xc0\0\x11\x08\0\1\0", 13);
  write_bytes(scratch / "b.jpg", jpeg.substr(0, 2) + segment + jpeg.substr(2));
  const auto behind = io::size_in_header(scratch / "b.jpg", "jpeg");
  REQUIRE(behind);
  CHECK(behind->height == 513);
  // A frame without a height, no frame, no header: for the library.
  std::string open = jpeg;
  const std::size_t frame = open.find("\xff\xc0");
  REQUIRE(frame != std::string::npos);
  open[frame + 5] = open[frame + 6] = 0;
  write_bytes(scratch / "c.jpg", open);
  CHECK_FALSE(io::size_in_header(scratch / "c.jpg", "jpeg"));
  for (std::size_t length = 0; length < frame + 9; ++length) {
    write_bytes(scratch / "c.jpg", jpeg.substr(0, length));
    CHECK_FALSE(io::size_in_header(scratch / "c.jpg", "jpeg"));
  }
  CHECK_FALSE(io::size_in_header(scratch / "a.png", "openexr"));
}

TEST_CASE("WebP is read, and refused when it is cut") {
  const Scratch scratch;
  std::vector<std::uint8_t> pixels(40 * 30 * 3);
  for (std::size_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<std::uint8_t>(i / 15);
  write_raw(scratch / "a.webp", 3, OIIO::TypeUInt8, pixels.data(), 40, 30);
  const Image image = read_image(scratch / "a.webp");
  CHECK(image.width == 40);
  CHECK(io::image_size(scratch / "a.webp").height == 30);
  CHECK(std::abs(image.at(20, 15, 1) - static_cast<float>(pixels[(15 * 40 + 20) * 3 + 1]) / 255) <
        0.1f);
  const std::string whole = read_bytes(scratch / "a.webp");
  write_bytes(scratch / "cut.webp", whole.substr(0, whole.size() / 2));
  CHECK(read_error(scratch / "cut.webp") != "");
}

TEST_CASE("JPEG is close to the original and drops alpha") {
  const Scratch scratch;
  const Image image = gradient(64, 48, 4);
  write_image(scratch / "a.jpg", image);
  const Image read = read_image(scratch / "a.jpg");
  CHECK(read.channels == 3);
  double worst = 0;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      for (int c = 0; c < 3; ++c) {
        worst =
            std::max(worst, std::abs(static_cast<double>(read.at(x, y, c) - image.at(x, y, c))));
      }
    }
  }
  CHECK(worst < 0.03);
}

TEST_CASE("Radiance HDR is read as float, with its exponents") {
  const Scratch scratch;
  std::string bytes = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n";
  // Mantissas over 256 times two to the exponent - 128.
  for (const int value : {128, 64, 32, 129, 128, 128, 0, 132}) {
    bytes.push_back(static_cast<char>(value));
  }
  write_bytes(scratch / "a.hdr", bytes);
  const Image image = read_image(scratch / "a.hdr");
  REQUIRE(image.width == 2);
  REQUIRE(image.channels == 3);
  const std::vector<float> expected{1.0f, 0.5f, 0.25f, 8.0f, 8.0f, 0.0f};
  for (std::size_t i = 0; i < expected.size(); ++i) {
    // Some readers add half a step of the mantissa.
    CHECK(std::abs(image.data[i] - expected[i]) <= 0.04f * std::max(expected[i], 1.0f));
  }
  write_bytes(scratch / "b.hdr", bytes.substr(0, bytes.size() - 6));
  CHECK(contains(data_error([&] { read_image(scratch / "b.hdr"); }), "b.hdr"));
}

TEST_CASE("TIFF, BMP, 16-bit PNG and uppercase extensions are read as value over maximum") {
  const Scratch scratch;
  const std::array<std::uint16_t, 6> wide{0, 1, 257, 32768, 65534, 65535};
  for (const char* name : {"a.png", "a.tif"}) {
    write_raw(scratch / name, 3, OIIO::TypeUInt16, wide.data(), 2, 1);
    const Image image = read_image(scratch / name);
    for (std::size_t i = 0; i < wide.size(); ++i) {
      CHECK(image.data[i] == doctest::Approx(wide[i] / 65535.0).epsilon(1e-6));
    }
  }
  const std::array<std::uint8_t, 6> bytes{0, 1, 100, 128, 254, 255};
  write_raw(scratch / "a.bmp", 3, OIIO::TypeUInt8, bytes.data(), 2, 1);
  CHECK(read_image(scratch / "a.bmp").data[2] == doctest::Approx(100 / 255.0));
  const std::array<float, 4> rgba{0.25f, 0.5f, 0.75f, 0.5f};
  write_raw(scratch / "straight.tiff", 4, OIIO::TypeFloat, rgba.data(), 1, 1);
  CHECK(read_image(scratch / "straight.tiff").data == std::vector<float>(rgba.begin(), rgba.end()));
  fs::copy_file(scratch / "a.bmp", scratch / "B.BMP");
  CHECK(read_image(scratch / "B.BMP").width == 2);
  // The content decides, as with photos that were renamed.
  fs::copy_file(scratch / "a.png", scratch / "renamed.jpg");
  CHECK(read_image(scratch / "renamed.jpg").width == 2);
  CHECK(io::image_size(scratch / "renamed.jpg").height == 1);
}

TEST_CASE("missing, empty, foreign and truncated images are refused with one sentence") {
  const Scratch scratch;
  CHECK(contains(read_error(scratch / "none.png"), "does not exist"));
  fs::create_directory(scratch / "folder.png");
  CHECK(contains(read_error(scratch / "folder.png"), "not a file"));
  write_bytes(scratch / "empty.png", "");
  CHECK(contains(read_error(scratch / "empty.png"), "empty"));
  write_bytes(scratch / "text.png", "this is text");
  CHECK(contains(read_error(scratch / "text.png"), "corrupt"));
  write_bytes(scratch / "a.psd", "8BPS");
  CHECK(contains(read_error(scratch / "a.psd"), "extension"));
  const Image image = gradient(200, 150, 3);
  for (const char* name : {"a.png", "a.jpg", "a.exr"}) {
    write_image(scratch / name, image);
    const std::string whole = read_bytes(scratch / name);
    for (const double share : {0.01, 0.3, 0.6, 0.97}) {
      const std::string cut = "cut" + (scratch / name).extension().string();
      write_bytes(
          scratch / cut,
          whole.substr(0, static_cast<std::size_t>(share * static_cast<double>(whole.size()))));
      const std::string message = read_error(scratch / cut);
      CHECK((contains(message, "copy it again") || contains(message, "corrupt")));
    }
  }
  for (const char* name : {"a.tif", "a.bmp", "a.webp"}) {
    std::vector<std::uint8_t> pixels(200 * 150 * 3, 77);
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = static_cast<std::uint8_t>(i * i / 7);
    write_raw(scratch / name, 3, OIIO::TypeUInt8, pixels.data(), 200, 150);
    const std::string whole = read_bytes(scratch / name);
    write_bytes(scratch / "cut" += fs::path(name).extension(), whole.substr(0, whole.size() / 2));
    CHECK(contains(read_error((scratch / "cut") += fs::path(name).extension()), "copy it again"));
  }
}

TEST_CASE("a size beyond the limit is refused before the pixels are decoded") {
  const Scratch scratch;
  std::string png("\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\0\0\0\1\0\0\x08\x02\0\0\0",
                  29);  // 65536 x 65536
  // The CRC of this IHDR, so that the header is valid.
  std::uint32_t crc = 0xffffffffu;
  for (std::size_t i = 12; i < 29; ++i) {
    crc ^= static_cast<std::uint8_t>(png[i]);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1u) != 0 ? 0xedb88320u : 0u);
  }
  crc = ~crc;
  for (int shift = 24; shift >= 0; shift -= 8) png += static_cast<char>(crc >> shift);
  png += std::string("\0\0\0\0IDAT\x35\xaf\x06\x1e\0\0\0\0IEND\xae\x42\x60\x82", 24);
  write_bytes(scratch / "huge.png", png);
  CHECK(contains(read_error(scratch / "huge.png"), "65536 x 65536"));
}

TEST_CASE("no damaged byte of an image does anything but load or raise DataError") {
  const Scratch scratch;
  CounterRng rng(3, 4);
  for (const char* name : {"a.png", "a.jpg", "a.exr"}) {
    write_image(scratch / name, gradient(20, 15, 3));
    const std::string whole = read_bytes(scratch / name);
    for (int trial = 0; trial < 150; ++trial) {
      std::string bytes = whole;
      for (int i = 0; i < 3; ++i)
        bytes[rng.below(bytes.size())] = static_cast<char>(rng.below(256));
      const fs::path bad = scratch / (std::string("bad") + fs::path(name).extension().string());
      write_bytes(bad, bytes);
      try {
        read_image(bad);
      } catch (const DataError&) {
      }
    }
  }
}

TEST_CASE("images that cannot be written leave nothing behind") {
  const Scratch scratch;
  const Image image = gradient(8, 8, 3);
  CHECK(contains(data_error([&] { write_image(scratch / "a.tga", image); }), ".png, .jpg or .exr"));
  CHECK(data_error([&] { write_image(scratch / "a.png", Image()); }) != "");
  CHECK(data_error([&] { write_image(scratch / "a.png", image, {"Z"}); }) != "");
  CHECK(data_error([&] { write_image(scratch / "a.exr", gradient(8, 8, 5)); }) != "");
  CHECK(fs::is_empty(scratch.path()));
  write_bytes(scratch / "file", "x");
  CHECK(contains(data_error([&] { write_image(scratch / "file" / "a.png", image); }), "a.png"));
  if (::geteuid() != 0) {
    fs::create_directory(scratch / "locked");
    fs::permissions(scratch / "locked", fs::perms::owner_read | fs::perms::owner_exec);
    CHECK(contains(data_error([&] { write_image(scratch / "locked" / "a.png", image); }), "a.png"));
    fs::permissions(scratch / "locked", fs::perms::owner_all);
  }
}

TEST_CASE("a disk that runs full keeps the old file and leaves nothing half-written") {
  const Scratch scratch;
  Image image(100, 100, 3);
  CounterRng rng(12, 13);
  for (float& value : image.data) value = static_cast<float>(rng.uniform());
  for (const char* name : {"a.png", "a.jpg", "a.exr"}) {
    write_bytes(scratch / name, "old");
    // Writing beyond the limit fails as on a full disk, once the signal is ignored.
    rlimit old_limit{};
    REQUIRE(::getrlimit(RLIMIT_FSIZE, &old_limit) == 0);
    const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{4096, old_limit.rlim_max};
    ::setrlimit(RLIMIT_FSIZE, &limit);
    const std::string message = data_error([&] { write_image(scratch / name, image); });
    ::setrlimit(RLIMIT_FSIZE, &old_limit);
    std::signal(SIGXFSZ, old_handler);
    CHECK(contains(message, name));
    CHECK(read_bytes(scratch / name) == "old");
  }
  CHECK(std::distance(fs::directory_iterator(scratch.path()), {}) == 3);
}
