// SPDX-License-Identifier: Apache-2.0
// What the files of photos say of their colours: light, alpha that multiplies, bands.
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/photo/photo.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/io/photo_view.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// Writes one row of numbers with OpenImageIO itself. Channels beyond those named R, G, B, Y or A
/// are any other bands.
template <class T>
fs::path write_row(const fs::path& path,
                   const std::vector<std::string>& channels,
                   const std::vector<T>& numbers,
                   bool straight = false) {
  const OIIO::TypeDesc type = OIIO::BaseTypeFromC<T>::value;
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  const auto count = static_cast<int>(channels.size());
  OIIO::ImageSpec spec(static_cast<int>(numbers.size()) / count, 1, count, type);
  spec.channelnames = channels;
  const auto alpha = std::find(channels.begin(), channels.end(), "A");
  spec.alpha_channel = alpha == channels.end() ? -1 : static_cast<int>(alpha - channels.begin());
  if (straight) spec.attribute("oiio:UnassociatedAlpha", 1);
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(type, numbers.data()));
  REQUIRE(output->close());
  return path;
}

/// The numbers of the photo of a file, which are the same for both who ask for them.
std::vector<float> photo_of(const fs::path& path) {
  const View view = view_of(path);
  const Image picture = load_view_image(view);
  const io::Photo photo = io::load_photo(view);
  const double step = view.sample_bytes == 1 ? 255 : view.sample_bytes == 2 ? 65535 : 1e7;
  for (int x = 0; x < picture.width; ++x) {
    for (int c = 0; c < 4; ++c) {
      const double rounded = static_cast<double>(photo.at(x, 0)[static_cast<std::size_t>(c)]);
      CHECK(std::abs(rounded - static_cast<double>(picture.at(x, 0, c))) <= 0.5001 / step);
    }
  }
  return picture.data;
}

void check_near(const std::vector<float>& got,
                const std::vector<double>& expected,
                double tolerance = 1e-6) {
  REQUIRE(got.size() == expected.size());
  for (std::size_t i = 0; i < got.size(); ++i) {
    CAPTURE(i);
    CHECK(std::abs(static_cast<double>(got[i]) - expected[i]) <= tolerance);
  }
}

/// The least of an ICC profile (ICC.1:2001, clauses 6.1 and 6.4.32): a header, and a description.
std::string icc_profile(const std::string& name, const std::string& colors = "RGB ") {
  const auto big_endian = [](std::size_t value) {
    std::string out;
    for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(value >> shift & 0xff);
    return out;
  };
  std::string description = "desc" + big_endian(0) + big_endian(name.size() + 1) + name;
  description += std::string(1 + 4 + 4 + 2 + 1 + 67, '\0');
  description.resize((description.size() + 3) / 4 * 4, '\0');
  constexpr std::size_t kHeader = 128, kTable = 16;
  std::string header = big_endian(kHeader + kTable + description.size());
  header += "none" + big_endian(0x02400000) + "mntr" + colors + "XYZ " + std::string(12, '\0');
  header += "acsp" + std::string(28, '\0');
  header += big_endian(0xf6d6) + big_endian(0x10000) + big_endian(0xd32d);  // D50
  header.resize(kHeader, '\0');
  return header + big_endian(1) + "desc" + big_endian(kHeader + kTable) +
         big_endian(description.size()) + description;
}

void write_with_profile(const fs::path& path, const std::string& profile) {
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(40, 30, 3, OIIO::TypeUInt8);
  if (!profile.empty()) {
    spec.attribute("ICCProfile",
                   OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(profile.size())),
                   profile.data());
  }
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(OIIO::TypeUInt8, std::vector<std::uint8_t>(3600, 90).data()));
  REQUIRE(output->close());
}

double light_of(double display) {
  return display <= 0.04045 ? display / 12.92 : std::pow((display + 0.055) / 1.055, 2.4);
}

}  // namespace

TEST_CASE("EXR and HDR photos hold light and become display values, other floats are such") {
  const Scratch scratch;
  const std::vector<double> display{0.5, 0.02, 0.9, 1.0, 0.25, 0.0};
  std::vector<float> light;
  for (const double value : display) light.push_back(static_cast<float>(light_of(value)));
  const std::vector<double> photo{0.5, 0.02, 0.9, 1, 1, 0.25, 0, 1};
  const std::vector<std::string> rgb{"R", "G", "B"};
  const fs::path exr = write_row(scratch / "a.exr", rgb, light);
  check_near(photo_of(exr), photo);
  // Eight bits of mantissa, shared by the colours of a pixel.
  const fs::path hdr = write_row(scratch / "a.hdr", rgb, light);
  check_near(photo_of(hdr), photo, 0.05);
  const fs::path tiff = write_row(scratch / "a.tif", rgb, light);
  for (std::size_t i = 0; i < 3; ++i) CHECK(photo_of(tiff)[i] == light[i]);
  // As what is no photo they are the numbers of their files.
  CHECK(read_image(exr).data == light);
  CHECK(read_image(hdr).data[0] == doctest::Approx(light[0]).epsilon(0.01));
  // Grey is light too, and whatever exceeds the display is its end.
  write_row(scratch / "grey.exr", {"Y"}, std::vector<float>{light[0], 7.0f, -1.0f, std::nanf("")});
  check_near(photo_of(scratch / "grey.exr"),
             {0.5, 0.5, 0.5, 1, 1, 1, 1, 1, 0, 0, 0, 1, 0, 0, 0, 1});
}

TEST_CASE("alpha that multiplies the light of an EXR is taken out before the curve") {
  const Scratch scratch;
  const auto part = [](double display) { return static_cast<float>(0.25 * light_of(display)); };
  const std::vector<float> numbers{part(0.5), part(0.8), part(1.0), 0.25f,  //
                                   0.0f,      0.0f,      0.0f,      0.0f};
  const fs::path path = write_row(scratch / "a.exr", {"R", "G", "B", "A"}, numbers);
  check_near(photo_of(path), {0.5, 0.8, 1.0, 0.25, 0, 0, 0, 0});
  CHECK(read_image(path).data == numbers);
}

TEST_CASE("alpha that multiplies a TIFF is taken out, where its tag says that it does") {
  const Scratch scratch;
  const std::vector<std::string> rgba{"R", "G", "B", "A"};
  const std::vector<std::uint8_t> bytes{50, 100, 25, 100, 7, 7, 7, 0};
  std::vector<std::uint16_t> shorts;
  std::vector<float> floats;
  for (const std::uint8_t byte : bytes) {
    shorts.push_back(static_cast<std::uint16_t>(257 * byte));
    floats.push_back(static_cast<float>(byte) / 255.0f);
  }
  const double alpha = 100.0 / 255, rest = 7.0 / 255;
  const std::vector<double> divided{0.5, 1.0, 0.25, alpha, rest, rest, rest, 0};
  std::vector<double> straight(floats.begin(), floats.end());
  for (const bool is_straight : {false, true}) {
    const std::vector<double>& expected = is_straight ? straight : divided;
    CAPTURE(is_straight);
    check_near(photo_of(write_row(scratch / "a.tif", rgba, bytes, is_straight)), expected);
    check_near(photo_of(write_row(scratch / "b.tif", rgba, shorts, is_straight)), expected);
    check_near(photo_of(write_row(scratch / "c.tif", rgba, floats, is_straight)), expected);
    CHECK(read_image(scratch / "c.tif").data == floats);
  }
  check_near(photo_of(write_row(scratch / "grey.tif", {"Y", "A"},
                                std::vector<std::uint8_t>{50, 100, 255, 255})),
             {0.5, 0.5, 0.5, alpha, 1, 1, 1, 1});
  // That of PNG never multiplies.
  check_near(photo_of(write_row(scratch / "a.png", rgba, bytes, true)), straight);
}

TEST_CASE("alpha of WebP does not multiply, whatever the decoder makes of it") {
  const Scratch scratch;
  // 8 x 8 pixels of 200, 100, 50 with alpha 128, lossless.
  const std::string bytes(
      "\x52\x49\x46\x46\x1e\x00\x00\x00\x57\x45\x42\x50\x56\x50\x38\x4c\x11\x00\x00\x00"
      "\x2f\x07\xc0\x01\x10\x07\x50\xb2\x22\x57\xa6\x80\x81\x88\xe8\x7f\x00\x00",
      38);
  write_bytes(scratch / "a.webp", bytes);
  const Image picture = load_view_image(view_of(scratch / "a.webp"));
  const double expected[] = {200, 100, 50, 128};
  for (int c = 0; c < 4; ++c)
    CHECK(std::abs(255 * static_cast<double>(picture.at(3, 5, c)) - expected[c]) < 1.5);
}

TEST_CASE("EXR files of our own come back as they were drawn, as light or as display values") {
  const Scratch scratch;
  Image display(3, 1, 4), light(3, 1, 4);
  // With the background in it, as what is drawn has it.
  display.data = {0.5f, 0.25f, 0.125f, 0.5f, 1.0f, 1.0f, 0.0f, 0.0f, 0.9f, 0.02f, 0.3f, 1.0f};
  for (std::size_t i = 0; i < display.data.size(); ++i) {
    light.data[i] = i % 4 == 3 ? display.data[i]
                               : static_cast<float>(light_of(static_cast<double>(display.data[i])));
  }
  const std::vector<double> expected(display.data.begin(), display.data.end());
  write_image(scratch / "display.exr", display, {}, ColorSpace::kDisplay);
  write_image(scratch / "linear.exr", light, {}, ColorSpace::kLinear);
  write_image(scratch / "any.exr", light);
  CHECK(photo_of(scratch / "display.exr") == display.data);
  check_near(photo_of(scratch / "linear.exr"), expected);
  check_near(photo_of(scratch / "any.exr"), expected);
  CHECK(read_image(scratch / "display.exr").data == display.data);
  CHECK(read_image(scratch / "linear.exr").data == light.data);
}

TEST_CASE("a band that is no alpha is left out, where an alpha lies behind it or none") {
  const Scratch scratch;
  const auto check = [&](const std::vector<std::string>& channels,
                         const std::vector<std::uint8_t>& bytes,
                         const std::vector<std::uint8_t>& expected) {
    const fs::path path = write_row(scratch / "a.tif", channels, bytes, true);
    std::vector<std::uint16_t> shorts;
    for (const std::uint8_t byte : bytes) shorts.push_back(static_cast<std::uint16_t>(257 * byte));
    const io::RawImage raw = io::read_raw_image(path);
    CHECK(raw.channels == static_cast<int>(expected.size()) / 2);
    CHECK(std::get<std::vector<std::uint8_t>>(raw.numbers) == expected);
    const Image wide = read_image(write_row(scratch / "b.tif", channels, shorts, true));
    CHECK(wide.data == read_image(path).data);
  };
  check({"R", "G", "B", "NIR"}, {1, 2, 3, 40, 5, 6, 7, 80}, {1, 2, 3, 5, 6, 7});
  check({"R", "G", "B", "RedEdge", "NIR"}, {1, 2, 3, 40, 50, 5, 6, 7, 80, 90}, {1, 2, 3, 5, 6, 7});
  check({"R", "G", "B", "NIR", "A"}, {1, 2, 3, 40, 50, 5, 6, 7, 80, 90},
        {1, 2, 3, 50, 5, 6, 7, 90});
  check({"R", "G", "B", "A"}, {1, 2, 3, 40, 5, 6, 7, 80}, {1, 2, 3, 40, 5, 6, 7, 80});
  check({"Y", "NIR"}, {1, 2, 3, 4}, {1, 3});
  check({"Y", "A"}, {1, 2, 3, 4}, {1, 2, 3, 4});
  CHECK(load_view_image(view_of(write_row(scratch / "n.tif", {"R", "G", "B", "NIR"},
                                          std::vector<std::uint8_t>{10, 20, 30, 0})))
            .at(0, 0, 3) == 1.0f);
}

TEST_CASE("integers of 32 bits are a photo where they fill their range, else of unknown white") {
  const Scratch scratch;
  const fs::path path = scratch / "a.tif";
  const auto most = std::uint32_t{0xffffffff};
  // A dark photo of the whole range.
  const Image dark = read_image(write_row<std::uint32_t>(path, {"Y"}, {0, most / 10, most / 5}));
  CHECK(dark.data[0] == 0.0f);
  CHECK(dark.data[2] == doctest::Approx(0.2));
  CHECK(photo_of(write_row<std::int32_t>(path, {"Y"}, {0, 0x7fffffff}))[4] == 1.0f);
  // Nothing but black is that in any range.
  CHECK(read_image(write_row<std::uint32_t>(path, {"Y"}, {0, 0})).data == std::vector<float>{0, 0});
  const auto message = [&] { return data_error([&] { read_image(path); }); };
  write_row<std::uint32_t>(path, {"R", "G", "B"}, {12, 255, 7, 0, 1, 2});
  CHECK(
      contains(message(), "a.tif has integers of more than 16 bits, of which the greatest is 255"));
  write_row<std::int32_t>(path, {"Y"}, {-9, 65535, 40});
  CHECK(contains(message(), "the greatest is 65535"));
  // Alpha tells nothing of white.
  write_row<std::uint32_t>(path, {"R", "G", "B", "A"}, {9, 9, 9, most}, true);
  CHECK(contains(message(), "the greatest is 9:"));
}

TEST_CASE("colours of another profile than sRGB are told once, of whatever format") {
  const std::string wide = icc_profile("Display P3");
  const auto lines = [](const std::string& extension, const std::string& profile) {
    CAPTURE(extension);
    const Scratch scratch;
    std::string frames;
    for (int i = 0; i < 7; ++i) {
      const std::string name = fmt::format("p{}{}", i, extension);
      // The first of the five that are looked at has none.
      write_with_profile(scratch / name, i == 0 ? "" : profile);
      frames += fmt::format("{}{{\"file_path\": \"{}\", \"transform_matrix\": {}}}",
                            i > 0 ? ", " : "", name, matrix_json(i));
    }
    write_bytes(scratch / "transforms.json",
                fmt::format("{{\"fl_x\": 50, \"frames\": [{}]}}", frames));
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 7);
    if (log.lines() > 0) CHECK(log.contains("'Display P3'"));
    return log.lines();
  };
  for (const char* extension : {".jpg", ".png", ".tif"}) {
    CHECK(lines(extension, wide) == 1);
    CHECK(lines(extension, icc_profile("sRGB IEC61966-2.1")) == 0);
    CHECK(lines(extension, "") == 0);
  }
}

TEST_CASE("a PNG whose gAMA says that it is light is told, where nothing goes before it") {
  const auto told = [](const std::string& space, const std::string& profile) {
    const Scratch scratch;
    const auto output = OIIO::ImageOutput::create((scratch / "a.png").string());
    REQUIRE(output);
    OIIO::ImageSpec spec(40, 30, 3, OIIO::TypeUInt8);
    spec.attribute("oiio:ColorSpace", space);
    if (!profile.empty()) {
      spec.attribute("ICCProfile",
                     OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(profile.size())),
                     profile.data());
    }
    REQUIRE(output->open((scratch / "a.png").string(), spec));
    REQUIRE(output->write_image(OIIO::TypeUInt8, std::vector<std::uint8_t>(3600, 90).data()));
    REQUIRE(output->close());
    // The chunk is what is wanted here.
    const bool has_gamma = contains(read_bytes(scratch / "a.png"), "gAMA");
    CHECK(has_gamma == (space != "none"));
    write_bytes(scratch / "transforms.json",
                fmt::format("{{\"fl_x\": 50, \"frames\": [{{\"file_path\": \"a.png\", "
                            "\"transform_matrix\": {}}}]}}",
                            matrix_json(0)));
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 1);
    CHECK(log.lines() == (log.contains("a.png are those of a gAMA of") ? 1u : 0u));
    return log.contains("gAMA of 1.00");
  };
  CHECK(told("Linear", ""));
  CHECK_FALSE(told("Linear", icc_profile("sRGB IEC61966-2.1")));
  CHECK_FALSE(told("Gamma2.2", ""));
  CHECK_FALSE(told("sRGB", ""));
  CHECK_FALSE(told("none", ""));
}

TEST_CASE("the size of a JPEG is found behind a profile of many segments") {
  const Scratch scratch;
  write_with_profile(scratch / "a.jpg", icc_profile(std::string(150000, 'x')));
  CHECK(io::image_size(scratch / "a.jpg").width == 40);
  CHECK(io::image_size(scratch / "a.jpg").height == 30);
  const std::string whole = read_bytes(scratch / "a.jpg");
  for (const std::size_t length : {3u, 20u, 30u, 1000u, 70000u}) {
    write_bytes(scratch / "b.jpg", whole.substr(0, length));
    data_error([&] { io::image_size(scratch / "b.jpg"); });
    data_error([&] { io::color_profile(scratch / "b.jpg"); });
  }
}
