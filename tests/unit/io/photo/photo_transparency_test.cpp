// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_transparency.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cmath>
#include <functional>
#include <string>

#include "io/photo/photo.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kPhotos = 10;
constexpr int kWidth = 40, kHeight = 30;

using Alpha = std::function<float(int photo, int x, int y)>;

// A square that moves from photo to photo, and air around it.
float body(int photo, int x, int y) {
  return x >= 5 + photo && x < 20 + photo && y >= 5 && y < 25 ? 1.0f : 0.0f;
}

// A car that was cut away, in another place in each photo.
float holes(int photo, int x, int y) {
  return x >= 3 + 2 * photo && x < 15 + 2 * photo && y >= 12 && y < 22 ? 0.0f : 1.0f;
}

// Two corners that a lens does not fill.
float corners(int /*photo*/, int x, int y) { return x + y < 8 || x + y > 61 ? 0.0f : 1.0f; }

// A data set of photos: transforms.json of nerfstudio, or `file` of another kind.
void write_photos(const Scratch& scratch,
                  const Alpha& alpha,
                  const std::string& file = "transforms.json",
                  const std::string& keys = "") {
  std::string frames;
  for (int photo = 0; photo < kPhotos; ++photo) {
    Image image(kWidth, kHeight, 4, 0.5f);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        image.at(x, y, 0) = static_cast<float>(x) / kWidth;
        image.at(x, y, 3) = alpha(photo, x, y);
      }
    }
    const std::string name = "photo_" + std::to_string(photo) + ".png";
    write_image(scratch / name, image);
    frames += std::string(photo > 0 ? ", " : "") + "{\"file_path\": \"" + name +
              "\", \"transform_matrix\": " + matrix_json(photo) + "}";
  }
  write_bytes(scratch / file,
              "{" + keys + "\"camera_angle_x\": 0.8, \"frames\": [" + frames + "]}");
}

bool background(const Scratch& scratch, AlphaUse use = AlphaUse::kAuto) {
  DatasetOptions options;
  options.alpha = use;
  return load_dataset(scratch.path(), options).alpha_is_background;
}

}  // namespace

TEST_CASE("what is transparent around a body is background, whoever wrote the data set") {
  for (const char* file : {"transforms.json", "transforms_train.json"}) {
    CAPTURE(file);
    const Scratch scratch;
    write_photos(scratch, body, file);
    CHECK(background(scratch));
    CHECK(background(scratch, AlphaUse::kCutout));
    CHECK_FALSE(background(scratch, AlphaUse::kIgnore));
  }
}

TEST_CASE("photos without anything transparent are not cut out") {
  for (const char* file : {"transforms.json", "transforms_train.json"}) {
    CAPTURE(file);
    const Scratch scratch;
    write_photos(
        scratch, [](int, int, int) { return 1.0f; }, file);
    CHECK_FALSE(background(scratch));
    CHECK(background(scratch, AlphaUse::kCutout));
  }
}

TEST_CASE("few photos with something transparent, or few pixels of all, do not make cut-outs") {
  const Scratch scratch;
  write_photos(scratch,
               [](int photo, int x, int y) { return photo % 5 == 0 ? body(photo, x, y) : 1.0f; });
  {
    const LogCapture log;
    CHECK_FALSE(background(scratch));
    CHECK(log.contains("2 of 10 photos have something transparent: it does not count"));
    CHECK_FALSE(background(scratch, AlphaUse::kIgnore));
    CHECK(log.lines() == 1);
  }
  write_photos(scratch, [](int photo, int x, int y) { return x == photo && y == 3 ? 0.0f : 1.0f; });
  CHECK_FALSE(background(scratch));
}

TEST_CASE("where a few photos disagree more of them are looked at") {
  // Three of the five, and no more of the ten.
  const Scratch scratch;
  write_photos(scratch, [](int photo, int x, int y) {
    return photo % 2 == 0 && photo < 6 ? body(photo, x, y) : 1.0f;
  });
  const LogCapture log;
  CHECK_FALSE(background(scratch));
  CHECK(log.contains("3 of 10 photos have"));
}

TEST_CASE("photos with alpha among others without are found, wherever they lie") {
  const Scratch scratch;
  write_photos(scratch, body);
  const auto make_opaque = [&](int photo) {
    write_image(scratch / ("photo_" + std::to_string(photo) + ".png"),
                Image(kWidth, kHeight, 3, 0.5f));
  };
  // Those that a few, evenly spread, would be.
  for (int photo = 0; photo < kPhotos; photo += 2) make_opaque(photo);
  const LogCapture log;
  CHECK_FALSE(background(scratch));
  CHECK(log.contains("5 of 10 photos have"));
  write_photos(scratch, body);
  for (const int photo : {0, 2, 4, 6}) make_opaque(photo);
  CHECK(background(scratch));
}

TEST_CASE("a border that all photos share is unknown, unless they are rendered or it is most") {
  const Scratch scratch;
  write_photos(scratch, corners);
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(io::transparency(dataset.views).kind == io::Transparency::kBorder);
  CHECK_FALSE(dataset.alpha_is_background);
  CHECK(background(scratch, AlphaUse::kCutout));
  // On a turntable what is symmetric has the same outline in all photos.
  write_photos(scratch, [](int, int x, int y) { return body(5, x, y); });
  CHECK(background(scratch));
  const Scratch rendered;
  write_photos(rendered, corners, "transforms_train.json");
  CHECK(background(rendered));
}

TEST_CASE("holes in photos are unknown, unless the photos are rendered") {
  const Scratch scratch;
  write_photos(scratch, holes);
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    CHECK_FALSE(dataset.alpha_is_background);
    CHECK(io::transparency(dataset.views).kind == io::Transparency::kHoles);
    CHECK(load_view_picture(dataset.views[0]).rgba.at(5, 15, 3) == 0.0f);
    CHECK(log.contains("The photos have holes"));
    CHECK(log.contains("alpha = cutout makes it background"));
    CHECK(log.lines() == 1);
  }
  CHECK(background(scratch, AlphaUse::kCutout));
  const Scratch rendered;
  write_photos(rendered, holes, "transforms_train.json");
  CHECK(background(rendered));
}

TEST_CASE("the median photo tells holes from a body that fills some of its photos") {
  const Scratch scratch;
  const auto close_up = [](int photo, int x, int y) {
    return x < 20 + photo && y > 3 ? 1.0f : 0.0f;
  };
  for (const int others : {3, 7}) {
    CAPTURE(others);
    // Where the edge is opaque there is a hole, as between an arm and the body.
    write_photos(scratch, [&](int photo, int x, int y) {
      return photo < others ? close_up(photo, x, y) : holes(photo, x, y);
    });
    CHECK(background(scratch) == (others > kPhotos / 2));
  }
}

TEST_CASE("a mask of cut-out photos is a plane of its own, whoever wrote the data set") {
  const Scratch scratch;
  write_photos(scratch, body);
  Image mask(kWidth, kHeight, 1, 1.0f);
  for (int x = 0; x < kWidth; ++x) mask.at(x, 0, 0) = 0.0f;
  write_image(scratch / "masks/photo_3.png", mask);
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(dataset.alpha_is_background);
  CHECK_FALSE(dataset.views[2].mask_apart);
  REQUIRE(dataset.views[3].mask_apart);
  const ViewPicture picture = load_view_picture(dataset.views[3]);
  CHECK(picture.weight.at(20, 0, 0) == 0.0f);
  CHECK(picture.weight.at(20, 9, 0) == 1.0f);
  CHECK(picture.rgba.at(10, 9, 3) == 1.0f);
  CHECK(picture.rgba.at(2, 9, 3) == 0.0f);
}

TEST_CASE("masks that cut out say nothing of what photos do not show: white ones change nothing") {
  for (const bool with_alpha : {true, false}) {
    for (const bool lens : {true, false}) {
      CAPTURE(with_alpha);
      CAPTURE(lens);
      const Scratch scratch;
      const auto alpha = [&](int photo, int x, int y) {
        return with_alpha ? holes(photo, x, y) : 1.0f;
      };
      write_photos(scratch, alpha, "transforms.json",
                   lens ? "\"k1\": 0.3, \"camera_model\": \"OPENCV\", " : "");
      DatasetOptions options;
      options.alpha = AlphaUse::kIgnore;
      options.downscale = 2;
      const Dataset bare = load_dataset(scratch.path(), options);
      // All but one, as photos without a mask count whole.
      for (int i = 1; i < kPhotos; ++i)
        write_image(scratch / fmt::format("masks/photo_{}.png", i),
                    Image(kWidth, kHeight, 1, 1.0f));
      options.masks = MaskUse::kCutout;
      const Dataset cut = load_dataset(scratch.path(), options);
      REQUIRE(cut.views.size() == bare.views.size());
      for (std::size_t i = 0; i < cut.views.size(); ++i) {
        CAPTURE(i);
        const ViewPicture without = load_view_picture(bare.views[i]);
        const ViewPicture with = load_view_picture(cut.views[i]);
        const io::Photo kept = io::load_photo(cut.views[i]);
        const bool some_unknown = with_alpha || lens;
        const bool weighted = !with.weight.data.empty();
        REQUIRE((weighted || !some_unknown));
        std::size_t unknown = 0;
        for (int y = 0; y < with.rgba.height; ++y) {
          for (int x = 0; x < with.rgba.width; ++x) {
            const float weight = without.rgba.at(x, y, 3);
            REQUIRE((weighted ? with.weight.at(x, y, 0) : 1.0f) == weight);
            REQUIRE(std::abs(kept.weight(x, y) - weight) <= 0.5001f / 255);
            unknown += weight < 1.0f ? 1 : 0;
            if (weight == 0.0f) continue;
            REQUIRE(with.rgba.at(x, y, 3) == 1.0f);
            for (int c = 0; c < 3; ++c) REQUIRE(with.rgba.at(x, y, c) == without.rgba.at(x, y, c));
          }
        }
        CHECK((unknown > 0) == some_unknown);
      }
    }
  }
}

TEST_CASE("a mask that cuts out is the coverage of what the photo shows") {
  const Scratch scratch;
  write_photos(scratch, holes);
  Image mask(kWidth, kHeight, 1, 1.0f);
  for (int y = 0; y < kHeight; ++y) mask.at(20, y, 0) = 0.0f;
  for (int i = 0; i < kPhotos; ++i)
    write_image(scratch / fmt::format("masks/photo_{}.png", i), mask);
  DatasetOptions options;
  options.masks = MaskUse::kCutout;
  const LogCapture log;
  const Dataset dataset = load_dataset(scratch.path(), options);
  CHECK(dataset.alpha_is_background);
  CHECK(log.contains("and does not count"));
  const ViewPicture picture = load_view_picture(dataset.views[0]);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      REQUIRE(picture.weight.at(x, y, 0) == holes(0, x, y));
      if (picture.weight.at(x, y, 0) > 0) REQUIRE(picture.rgba.at(x, y, 3) == mask.at(x, y, 0));
    }
  }
  // What shows all of its pixels needs no weights.
  write_image(scratch / "photo_0.png", Image(kWidth, kHeight, 3, 0.5f));
  const ViewPicture whole = load_view_picture(load_dataset(scratch.path(), options).views[0]);
  CHECK(whole.weight.data.empty());
  CHECK(whole.rgba.at(20, 15, 3) == 0.0f);
  // Of photos that are cut out themselves both say what is background.
  options.alpha = AlphaUse::kCutout;
  const ViewPicture both = load_view_picture(load_dataset(scratch.path(), options).views[1]);
  CHECK(both.weight.data.empty());
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x)
      REQUIRE(both.rgba.at(x, y, 3) == holes(1, x, y) * mask.at(x, y, 0));
  }
}

TEST_CASE("a black mask is of a photo without the body, but leaves nothing where it ignores") {
  const Scratch scratch;
  write_photos(scratch, [](int, int, int) { return 1.0f; });
  write_image(scratch / "masks/photo_3.png", Image(kWidth, kHeight, 1, 0.0f));
  DatasetOptions options;
  const Image ignored = load_view_image(load_dataset(scratch.path(), options).views[3]);
  for (std::size_t i = 3; i < ignored.data.size(); i += 4) REQUIRE(ignored.data[i] == 0.0f);
  options.masks = MaskUse::kCutout;
  const Dataset dataset = load_dataset(scratch.path(), options);
  CHECK(dataset.alpha_is_background);
  const ViewPicture picture = load_view_picture(dataset.views[3]);
  CHECK(picture.rgba.at(20, 9, 3) == 0.0f);
  CHECK(picture.rgba.at(2, 1, 3) == 0.0f);
}
