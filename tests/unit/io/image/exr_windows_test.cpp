// SPDX-License-Identifier: Apache-2.0
// EXR files whose pixels are those of another window than the picture's, and whose primaries are
// other than sRGB's.
#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <array>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

struct Window {
  int x, y, width, height;
};

/// Y and A of every pixel of the data: a number of its place, and 1.
fs::path write_windows(const fs::path& path, const Window& data, const Window& display) {
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(data.width, data.height, 2, OIIO::TypeFloat);
  spec.channelnames = {"Y", "A"};
  spec.alpha_channel = 1;
  spec.x = data.x, spec.y = data.y;
  spec.full_x = display.x, spec.full_y = display.y;
  spec.full_width = display.width, spec.full_height = display.height;
  std::vector<float> numbers;
  for (int y = data.y; y < data.y + data.height; ++y) {
    for (int x = data.x; x < data.x + data.width; ++x) {
      numbers.push_back(static_cast<float>(100 + 10 * y + x));
      numbers.push_back(1.0f);
    }
  }
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(OIIO::TypeFloat, numbers.data()));
  REQUIRE(output->close());
  return path;
}

}  // namespace

TEST_CASE("an EXR is its display window: what is trimmed is empty, what lies beyond is cut") {
  const Scratch scratch;
  const Window display{2, 1, 4, 3};
  for (const Window& data : {Window{2, 1, 4, 3}, Window{3, 2, 2, 1}, Window{0, -1, 8, 9},
                             Window{-3, 2, 7, 1}, Window{20, 20, 2, 2}, Window{3, -5, 1, 2}}) {
    CAPTURE(data.x);
    CAPTURE(data.y);
    const fs::path path = write_windows(scratch / "a.exr", data, display);
    const io::ImageSize size = io::image_size(path);
    CHECK(size.width == 4);
    CHECK(size.height == 3);
    const Image image = read_image(path);
    REQUIRE(image.width == 4);
    REQUIRE(image.height == 3);
    REQUIRE(image.channels == 2);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        const int x = display.x + column, y = display.y + row;
        const bool there =
            x >= data.x && x < data.x + data.width && y >= data.y && y < data.y + data.height;
        CHECK(image.at(column, row, 0) == (there ? static_cast<float>(100 + 10 * y + x) : 0.0f));
        CHECK(image.at(column, row, 1) == (there ? 1.0f : 0.0f));
      }
    }
  }
}

TEST_CASE("an EXR of a display window without bounds is refused") {
  const Scratch scratch;
  const fs::path path =
      write_windows(scratch / "a.exr", Window{0, 0, 2, 2}, Window{0, 0, 40000, 40000});
  CHECK(contains(data_error([&] { io::image_size(path); }), "a.exr"));
  CHECK(contains(data_error([&] { read_image(path); }), "a.exr"));
}

TEST_CASE("primaries of an EXR other than Rec. 709's are told as a profile is") {
  const Scratch scratch;
  write_bytes(scratch / "transforms.json",
              "{\"fl_x\": 50, \"frames\": [{\"file_path\": \"a.exr\", \"transform_matrix\": " +
                  matrix_json(0) + "}]}");
  write_image(scratch / "a.exr", Image(40, 30, 3, 0.5f));
  const auto warns = [&](const char* what) {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 1);
    return log.contains(what);
  };
  CHECK(io::color_profile(scratch / "a.exr") == "");
  CHECK(!warns("are taken as sRGB"));
  // ACEScg (Academy S-2014-004) in place of what was written.
  const std::array<float, 8> acescg{0.713f, 0.293f, 0.165f,   0.83f,
                                    0.128f, 0.044f, 0.32168f, 0.33767f};
  std::string bytes = read_bytes(scratch / "a.exr");
  const std::string attribute("chromaticities\0chromaticities\0", 30);
  const std::size_t at = bytes.find(attribute);
  REQUIRE(at != std::string::npos);
  std::memcpy(bytes.data() + at + attribute.size() + 4, acescg.data(), sizeof(acescg));
  write_bytes(scratch / "a.exr", bytes);
  CHECK(
      warns("'red 0.713 0.293, green 0.165 0.83, blue 0.128 0.044, white 0.3217 0.3377' but are"));
}
