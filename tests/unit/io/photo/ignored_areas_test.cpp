// SPDX-License-Identifier: Apache-2.0
// Boxes of all photos that do not count.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "io/dataset/data_option_table.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "unit/io/data_sets.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// Two photos of 40 x 20 pixels with as many channels.
void write_capture(const Scratch& scratch, int channels, const std::string& keys = "") {
  std::string frames;
  for (const char* name : {"0.png", "1.png"}) {
    Image photo(40, 20, channels, 0.5f);
    for (int y = 5; channels == 4 && y < 15; ++y) {
      for (int x = 10; x < 30; ++x) photo.at(x, y, 3) = 1.0f;
    }
    for (int y = 0; channels == 4 && y < 20; ++y) {
      for (int x = 0; x < 8; ++x) photo.at(x, y, 3) = 0.0f;
    }
    write_image(scratch / name, photo);
    frames += std::string(frames.empty() ? "" : ", ") + "{\"file_path\": \"" + name +
              "\", \"transform_matrix\": " + matrix_json(frames.empty() ? 0 : 1) + "}";
  }
  write_bytes(scratch / "transforms.json",
              "{\"fl_x\": 40, " + keys + "\"frames\": [" + frames + "]}");
}

DatasetOptions without(const std::vector<PhotoArea>& areas, double downscale = 1) {
  DatasetOptions options;
  options.downscale = downscale;
  options.ignore_areas = areas;
  return options;
}

std::string refusal(const Scratch& scratch, const DatasetOptions& options) {
  try {
    load_dataset(scratch.path(), options);
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("what lies in areas to ignore counts of no photo, at any size") {
  const Scratch scratch;
  write_capture(scratch, 3);
  const std::vector<PhotoArea> areas{{0.5, 0.7, 0.7, 1}, {0, 0, 0.1, 0.1}};
  for (const int divisor : {1, 2}) {
    CAPTURE(divisor);
    const Dataset dataset = load_dataset(scratch.path(), without(areas, divisor));
    for (const View& view : dataset.views) {
      const Image picture = load_view_image(view);
      REQUIRE(picture.width == 40 / divisor);
      for (int y = 0; y < picture.height; ++y) {
        for (int x = 0; x < picture.width; ++x) {
          const int u = x * divisor, v = y * divisor;
          const bool inside = (u >= 20 && u < 28 && v >= 14) || (u < 4 && v < 2);
          REQUIRE(picture.at(x, y, 3) == (inside ? 0.0f : 1.0f));
        }
      }
    }
  }
  // A part of a pixel takes all of it.
  const Dataset thin = load_dataset(scratch.path(), without({{0.51, 0, 0.52, 1}}));
  const Image picture = load_view_image(thin.views.front());
  CHECK(picture.at(19, 3, 3) == 1.0f);
  CHECK(picture.at(20, 3, 3) == 0.0f);
  CHECK(picture.at(21, 3, 3) == 1.0f);
}

TEST_CASE("areas to ignore are those of the photo, before its lens is taken out") {
  const Scratch scratch;
  write_capture(scratch, 3, "\"k1\": 0.4, ");
  const Dataset dataset = load_dataset(scratch.path(), without({{0, 0, 0.2, 1}}));
  const Image picture = load_view_image(dataset.views.front());
  // The area ends at x/z = -0.3 of the lens, which a pinhole sees at -0.29, within the next pixel.
  CHECK(picture.at(7, 10, 3) == 0.0f);
  CHECK(picture.at(8, 10, 3) < 0.9f);
  CHECK(picture.at(10, 10, 3) == 1.0f);
}

TEST_CASE("areas of cut-out photos are refused, and so are those that are no boxes") {
  const Scratch scratch;
  write_capture(scratch, 4);
  DatasetOptions options = without({{0, 0, 0.1, 0.1}});
  options.alpha = AlphaUse::kCutout;
  CHECK(contains(refusal(scratch, options), "these are cut out"));
  options.alpha = AlphaUse::kIgnore;
  CHECK(refusal(scratch, options).empty());
  for (const PhotoArea& area : {PhotoArea{0.5, 0, 0.5, 1}, PhotoArea{0, 0, 1.1, 1},
                                PhotoArea{0, 0.6, 1, 0.5}, PhotoArea{-0.1, 0, 1, 1}})
    CHECK(contains(refusal(scratch, without({area})), "is no box"));
}

TEST_CASE("areas to ignore are numbers, four for each") {
  DatasetOptions options;
  const std::vector<OptionRow> rows = data_option_rows(options);
  const OptionRow* row = find_row(rows, "ignore-areas");
  REQUIRE(row != nullptr);
  CHECK(row->text() == "[]");
  row->set({"0.1,0.2,0.3,0.4,0,0,1,0.05"});
  CHECK(options.ignore_areas == std::vector<PhotoArea>{{0.1, 0.2, 0.3, 0.4}, {0, 0, 1, 0.05}});
  CHECK(row->text() == "[0.1, 0.2, 0.3, 0.4, 0, 0, 1, 0.05]");
  const auto refused = [&](const char* value) {
    try {
      row->set({value});
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(contains(refused("0,0,1"), "4 numbers for each box"));
  CHECK(contains(refused("0,0,1,2"), "a number from 0 to 1"));
  CHECK(contains(refused("0.5,0,0.2,1"), "is no box"));
  CHECK(options.ignore_areas.size() == 2);
  row->set({"[]"});
  CHECK(options.ignore_areas.empty());
}
