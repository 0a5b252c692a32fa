// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_orientation.hpp"

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 40, kHeight = 30;  // of the picture as one looks at it

std::uint8_t shade(int x, int y) { return static_cast<std::uint8_t>(5 * x + y); }

// The picture as a telephone stores it: turned, so that the orientation makes it upright.
void write_photo(const fs::path& path, int orientation, int width, int height) {
  const bool side = orientation == 6 || orientation == 8;
  const int stored_width = side ? height : width, stored_height = side ? width : height;
  std::vector<std::uint8_t> numbers;
  for (int row = 0; row < stored_height; ++row) {
    for (int column = 0; column < stored_width; ++column) {
      // Orientation 6: the first row is the right side, the first column the top; 8: left, bottom.
      const int x = orientation == 6 ? width - 1 - row : orientation == 8 ? row : column;
      const int y = orientation == 6 ? column : orientation == 8 ? height - 1 - column : row;
      for (int c = 0; c < 3; ++c) numbers.push_back(shade(x, y));
    }
  }
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(stored_width, stored_height, 3, OIIO::TypeUInt8);
  spec.attribute("Orientation", orientation);
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(OIIO::TypeUInt8, numbers.data()));
  REQUIRE(output->close());
}

void write_cameras(const fs::path& folder, int width, int height) {
  write_bytes(folder / "transforms.json",
              "{\"fl_x\": 30, \"w\": " + std::to_string(width) +
                  ", \"h\": " + std::to_string(height) +
                  R"(, "frames": [{"file_path": "p.tif", "transform_matrix":
                     [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]})");
}

}  // namespace

TEST_CASE("photos that lie on their side are turned where cameras have the upright shape") {
  const Scratch scratch;
  write_cameras(scratch.path(), kWidth, kHeight);
  for (const int orientation : {1, 6, 8}) {
    CAPTURE(orientation);
    write_photo(scratch / "p.tif", orientation, kWidth, kHeight);
    CHECK(io::lies_on_its_side(scratch / "p.tif") == (orientation != 1));
    const Dataset dataset = load_dataset(scratch.path());
    const Image image = load_view_image(dataset.views[0]);
    REQUIRE(image.width == kWidth);
    REQUIRE(image.height == kHeight);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        CHECK(255.0 * image.at(x, y, 1) == doctest::Approx(shade(x, y)));
    }
  }
  // Cameras of twice the photo's size.
  write_cameras(scratch.path(), 2 * kWidth, 2 * kHeight);
  const Image half = load_view_image(load_dataset(scratch.path()).views[0]);
  CHECK(half.width == kWidth);
  CHECK(255.0 * half.at(39, 0, 0) == doctest::Approx(shade(39, 0)));
}

TEST_CASE("masks follow their photo, whether they were made of it lying or upright") {
  // White is the left third of the upright picture.
  const auto write_mask = [](const fs::path& path, int orientation, bool lying) {
    Image mask(lying ? kHeight : kWidth, lying ? kWidth : kHeight, 1, 0.0f);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < 13; ++x) {
        const int row = orientation == 6 ? kWidth - 1 - x : x;
        const int column = orientation == 6 ? y : kHeight - 1 - y;
        (lying ? mask.at(column, row, 0) : mask.at(x, y, 0)) = 1.0f;
      }
    }
    write_image(path, mask);
  };
  for (const int orientation : {6, 8}) {
    for (const bool photo_lies : {false, true}) {
      for (const bool mask_lies : {false, true}) {
        CAPTURE(orientation);
        CAPTURE(photo_lies);
        CAPTURE(mask_lies);
        const Scratch scratch;
        write_cameras(scratch.path(), photo_lies ? kHeight : kWidth, photo_lies ? kWidth : kHeight);
        write_photo(scratch / "p.tif", orientation, kWidth, kHeight);
        write_mask(scratch / "masks/p.png", orientation, mask_lies);
        const Image image = load_view_image(load_dataset(scratch.path()).views[0]);
        std::size_t wrong = 0;
        for (int y = 0; y < image.height; ++y) {
          for (int x = 0; x < image.width; ++x) {
            const int upright_x = !photo_lies ? x : orientation == 6 ? kWidth - 1 - y : y;
            wrong += (image.at(x, y, 3) == 1.0f) == (upright_x < 13) ? 0 : 1;
          }
        }
        CHECK(wrong == 0);
      }
    }
  }
}

TEST_CASE("photos of their camera's shape stay as they are stored, others are refused") {
  const Scratch scratch;
  write_cameras(scratch.path(), kHeight, kWidth);
  write_photo(scratch / "p.tif", 6, kWidth, kHeight);
  const Image stored = load_view_image(load_dataset(scratch.path()).views[0]);
  CHECK(stored.width == kHeight);
  CHECK(255.0 * stored.at(0, 0, 0) == doctest::Approx(shade(kWidth - 1, 0)));
  // Upright already, and of another shape than the camera.
  write_photo(scratch / "p.tif", 1, kWidth, kHeight);
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "another shape"));
}
