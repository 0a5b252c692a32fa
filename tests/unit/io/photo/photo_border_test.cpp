// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_border.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "util/srgb.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kPhotos = 12;
constexpr int kWidth = 64, kHeight = 48;
constexpr const char* kFisheye = R"("camera_model": "OPENCV_FISHEYE", "fl_x": 16, "fl_y": 16)";

// Whether a photo is black there.
using Black = std::function<bool(int photo, int x, int y)>;

// Brightness of what a camera sees that goes on from photo to photo.
float scenery(int photo, int x, int y) {
  return 0.5f + 0.3f * std::sin(0.4f * static_cast<float>(x + 3 * photo)) *
                    std::cos(0.5f * static_cast<float>(y + photo));
}

// Compression leaves this on black.
float speck(int photo, int x, int y) {
  return static_cast<float>((31 * photo + 17 * x + 7 * y) % 20) / 255.0f;
}

struct Photos {
  int count = kPhotos;
  std::string camera = "\"camera_angle_x\": 0.8";
  int channels = 3;
  std::function<std::string(int photo)> pose = [](int photo) { return matrix_json(photo); };
  std::function<std::string(int photo)> folder = [](int) { return std::string(); };
};

// Of a level camera at (x, y), turned to the left by an angle from looking along -y.
std::string level_pose(double x, double y, double turn) {
  const std::string c = std::to_string(-std::cos(turn)), s = std::to_string(-std::sin(turn));
  const std::string back = std::to_string(std::cos(turn));
  return "[[" + c + ", 0, " + s + ", " + std::to_string(x) + "], [" + s + ", 0, " + back + ", " +
         std::to_string(y) + "], [0, 1, 0, 0], [0, 0, 0, 1]]";
}

// As of a turntable: level, on a circle, to its middle.
std::string turntable(int photo) {
  const double angle = 0.5 * photo;
  return level_pose(-4 * std::sin(angle), 4 * std::cos(angle), angle);
}

// Around something too, as by hand.
std::string walk_around(int photo) {
  const double angle = 0.5 * photo, away = 4 + 0.8 * std::sin(2.3 * photo);
  return level_pose(-away * std::sin(angle), away * std::cos(angle),
                    angle + 0.1 * std::sin(1.7 * photo));
}

void write_photos(const Scratch& scratch, const Black& black, const Photos& photos = {}) {
  std::string frames;
  for (int photo = 0; photo < photos.count; ++photo) {
    Image image(kWidth, kHeight, photos.channels, 1.0f);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float value = black(photo, x, y) ? speck(photo, x, y) : scenery(photo, x, y);
        for (int c = 0; c < 3; ++c) image.at(x, y, c) = value;
      }
    }
    const std::string name = photos.folder(photo) + "photo_" + std::to_string(10 + photo) + ".png";
    write_image(scratch / name, image);
    frames += std::string(photo > 0 ? ", " : "") + "{\"file_path\": \"" + name +
              "\", \"transform_matrix\": " + photos.pose(photo) + "}";
  }
  write_bytes(scratch / "transforms.json", "{" + photos.camera + ", \"frames\": [" + frames + "]}");
}

bool bars(int /*photo*/, int /*x*/, int y) { return y < 6 || y >= kHeight - 8; }

bool has_borders(const Scratch& scratch, BorderUse use = BorderUse::kAuto) {
  DatasetOptions options;
  options.borders = use;
  const Dataset dataset = load_dataset(scratch.path(), options);
  const auto bordered = std::count_if(dataset.views.begin(), dataset.views.end(),
                                      [](const View& view) { return view.border != nullptr; });
  CHECK((bordered == 0 || bordered == static_cast<long>(dataset.views.size())));
  return bordered > 0;
}

// The share of the pixels that a border hides though they show something, and of those that it
// leaves though they do not.
struct Wrong {
  double hidden = 0;
  double left = 0;
};

Wrong wrong(const Scratch& scratch, const Black& black) {
  const Dataset dataset = load_dataset(scratch.path());
  REQUIRE(dataset.views.front().border);
  Wrong out;
  const Image picture = load_view_image(dataset.views.front());
  REQUIRE(picture.width == kWidth);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool counts = picture.at(x, y, 3) > 0;
      if (!black(0, x, y) && !counts) out.hidden += 1.0 / (kWidth * kHeight);
      if (black(0, x, y) && counts) out.left += 1.0 / (kWidth * kHeight);
    }
  }
  return out;
}

}  // namespace

TEST_CASE("the bars of a video do not count, in held-out photos neither, unless they are kept") {
  const Scratch scratch;
  write_photos(scratch, bars);
  const Dataset dataset = load_dataset(scratch.path());
  for (const View& view : dataset.views) {
    REQUIRE(view.border);
    // A pixel more, where pictures of bars are blurred.
    CHECK(view.border->top == std::vector<int>(kWidth, 7));
    CHECK(view.border->bottom == std::vector<int>(kWidth, 9));
    CHECK(view.border->left == std::vector<int>(kHeight, 0));
    CHECK(view.border->right == std::vector<int>(kHeight, 0));
    const Image picture = load_view_image(view);
    for (const int y : {0, 6, 39, 47}) CHECK(picture.at(30, y, 3) == 0.0f);
    for (const int y : {7, 20, 38}) CHECK(picture.at(30, y, 3) == 1.0f);
  }
  CHECK(io::hidden_share(*dataset.views.front().border) == doctest::Approx(16.0 / kHeight));
  CHECK_FALSE(has_borders(scratch, BorderUse::kKeep));
}

TEST_CASE("pixels of reduced photos count as far as no border takes them") {
  const Scratch scratch;
  write_photos(scratch, bars);
  DatasetOptions options;
  options.downscale = 4;
  const Image picture = load_view_image(load_dataset(scratch.path(), options).views.front());
  REQUIRE(picture.height == kHeight / 4);
  CHECK(picture.at(5, 0, 3) == 0.0f);
  CHECK(picture.at(5, 1, 3) == doctest::Approx(0.25));
  CHECK(picture.at(5, 1, 0) > 0.15f);  // of the row that counts alone
  CHECK(picture.at(5, 2, 3) == 1.0f);
}

TEST_CASE("borders may lie on all sides, bend, or surround the circle of a fisheye") {
  const auto window = [](int, int x, int y) {
    return x < 5 || x >= kWidth - 9 || y < 4 || y >= kHeight - 4;
  };
  const auto pillars = [](int, int x, int) { return x < 16 || x >= kWidth - 16; };
  // As photos are whose lens was taken out by another program.
  const auto bent = [](int, int x, int y) {
    const double u = (x + 0.5) / (kWidth / 2) - 1, v = (y + 0.5) / (kHeight / 2) - 1;
    const double stretch = 1 + 0.08 * (u * u + v * v);
    return std::abs(u * stretch) > 1.02 || std::abs(v * stretch) > 1.02;
  };
  for (const Black& black : {Black(window), Black(pillars), Black(bent)}) {
    const Scratch scratch;
    write_photos(scratch, black);
    const Wrong found = wrong(scratch, black);
    CHECK(found.left < 0.01);
    CHECK(found.hidden < 0.08);
  }
  const auto circle = [](int, int x, int y) {
    return std::hypot(x + 0.5 - kWidth / 2, y + 0.5 - kHeight / 2) > kHeight / 2;
  };
  const Scratch scratch;
  write_photos(scratch, circle, {.camera = kFisheye});
  const Wrong found = wrong(scratch, circle);
  CHECK(found.left < 0.02);
  CHECK(found.hidden < 0.08);
}

TEST_CASE("a black frame between others, and one with a speck in its bars, hide no border") {
  const Scratch scratch;
  write_photos(scratch, [](int photo, int x, int y) {
    if (photo == 1 || photo == 5) return true;  // photo 0 is held out
    return bars(photo, x, y) && !(photo == 4 && x == 20 && y == 2);
  });
  CHECK(has_borders(scratch));
}

TEST_CASE("what is black without being a border counts") {
  const auto moving_body = [](int photo, int x, int y) {
    return !(x >= 8 + 2 * photo && x < 28 + 2 * photo && y >= 6 && y < 40);
  };
  // A pillar that leaves the photo above and below, seen from above.
  const auto standing_pillar = [](int, int x, int y) {
    return std::abs(x + 0.5 - 32) > 21 - 0.06 * y;
  };
  const auto night_sky = [](int photo, int, int y) { return y < 8 + 5 * (photo % 5); };
  const auto hill_at_night = [](int, int x, int y) { return y < 4 + x / 2; };
  const auto one_row = [](int, int, int y) { return y < 1; };
  const auto nothing = [](int, int, int) { return false; };
  const auto everything = [](int, int, int) { return true; };
  for (const Black& black :
       {Black(moving_body), Black(standing_pillar), Black(night_sky), Black(hill_at_night),
        Black(one_row), Black(nothing), Black(everything)}) {
    const Scratch scratch;
    write_photos(scratch, black);
    CHECK_FALSE(has_borders(scratch));
  }
}

TEST_CASE("edges that outline one body for cameras around it are no border, and others are") {
  const auto body = [](int, int x, int y) { return !(x >= 20 && x < 44 && y >= 8 && y < 42); };
  const auto ball = [](int, int x, int y) {
    return std::hypot(x + 0.5 - kWidth / 2, y + 0.5 - kHeight / 2) > 20;
  };
  // Its edges are those of a window, but for the bent rim.
  const auto can = [](int, int x, int y) {
    const double u = (x + 0.5 - 32) / 22;
    return std::abs(u) > 1 || std::abs(y + 0.5 - 24) > 15 + 5 * std::sqrt(1 - u * u);
  };
  // Leaves the photo above and below, and one on the right too.
  const auto column = [](int, int x, int) { return x < 14 || x >= kWidth - 14; };
  const auto wide_column = [](int, int x, int) { return x < 14; };
  for (const Black& black :
       {Black(body), Black(ball), Black(can), Black(column), Black(wide_column)}) {
    const Scratch scratch;
    write_photos(scratch, black, {.pose = turntable});
    CHECK_FALSE(has_borders(scratch));
  }
  const auto lying = [](int, int, int y) { return y < 9 || y >= kHeight - 9; };
  const Scratch letterboxed;
  write_photos(letterboxed, lying, {.pose = turntable});
  CHECK(has_borders(letterboxed));
  for (const Black& black : {Black(body), Black(ball), Black(column), Black(wide_column)}) {
    const Scratch scratch;
    write_photos(scratch, black, {.pose = walk_around});
    const Wrong found = wrong(scratch, black);
    CHECK(found.left < 0.01);
    CHECK(found.hidden < 0.08);
  }
}

TEST_CASE("a ball is no circle of a fisheye") {
  const auto circle = [](int, int x, int y) {
    return std::hypot(x + 0.5 - kWidth / 2, y + 0.5 - kHeight / 2) > 20;
  };
  const Scratch ball;
  write_photos(ball, circle, {.camera = kFisheye, .pose = turntable});
  CHECK_FALSE(has_borders(ball));
  const Scratch lens;
  write_photos(lens, circle, {.camera = kFisheye, .pose = walk_around});
  CHECK(has_borders(lens));
}

TEST_CASE("a vertical video may have bars on all sides") {
  const auto window = [](int, int x, int y) {
    return x < 22 || x >= kWidth - 22 || y < 5 || y >= kHeight - 5;
  };
  const Scratch scratch;
  write_photos(scratch, window);
  const Wrong found = wrong(scratch, window);
  CHECK(found.left < 0.01);
  CHECK(found.hidden < 0.05);
}

TEST_CASE("clips in folders of their own have borders of their own") {
  const auto clips = [](int photo, int x, int y) {
    const int bar = photo < 12 ? 5 : 10;
    return photo >= 24 ? x < 8 : y < bar || y >= kHeight - bar;
  };
  const auto folder = [](int photo) { return "clip_" + std::to_string(photo / 12) + "/"; };
  const Scratch scratch;
  write_photos(scratch, clips, {.count = 36, .folder = folder});
  const Dataset dataset = load_dataset(scratch.path());
  REQUIRE(dataset.views.size() == 36);
  for (const View& view : dataset.views) {
    REQUIRE(view.border);
    const std::string clip = view.image_path.parent_path().filename().string();
    CHECK(view.border->top.front() == (clip == "clip_0" ? 6 : clip == "clip_1" ? 11 : 0));
    CHECK(view.border->left.front() == (clip == "clip_2" ? 9 : 0));
  }
}

TEST_CASE("a fisheye has the border of a circle, and none around a body") {
  const auto egg = [](int, int x, int y) {
    return std::hypot((x + 0.5 - 32) / 26, (y + 0.5 - 24) / 18) > 1;
  };
  const auto column = [](int, int x, int y) {
    return std::abs(x + 0.5 - 30) > 12 + 0.1 * y || y < 5 + (x - 30) * (x - 30) / 40;
  };
  for (const Black& black : {Black(egg), Black(column)}) {
    const Scratch scratch;
    write_photos(scratch, black, {.camera = kFisheye});
    CHECK_FALSE(has_borders(scratch));
  }
  const auto cut_circle = [](int, int x, int y) {
    return std::hypot(x + 0.5 - kWidth / 2, y + 0.5 - kHeight / 2) > 28;
  };
  const Scratch scratch;
  write_photos(scratch, cut_circle, {.camera = kFisheye});
  CHECK(wrong(scratch, cut_circle).left < 0.02);
}

TEST_CASE("a photo that shows something where the others have a border has none") {
  constexpr int kMany = 40;
  const Scratch scratch;
  const auto other_clip = [](int photo, int x, int y) {
    return photo % 10 != 9 && bars(photo, x, y);
  };
  write_photos(scratch, other_clip, {.count = kMany});
  const Dataset dataset = load_dataset(scratch.path());
  for (const int photo : {1, 9, 19, 20, 39}) {
    CAPTURE(photo);
    const auto view = std::find_if(dataset.views.begin(), dataset.views.end(), [&](const View& v) {
      return v.camera.name == "photo_" + std::to_string(10 + photo) + ".png";
    });
    REQUIRE(view != dataset.views.end());
    REQUIRE(view->border);
    CHECK(load_view_image(*view).at(30, 2, 3) == (photo % 10 == 9 ? 1.0f : 0.0f));
  }
}

TEST_CASE("black is as dark in photos of light as in others [small]") {
  // Of 255 as it is shown.
  for (const float level : {20.0f, 40.0f}) {
    const Scratch scratch;
    std::string frames;
    for (int photo = 0; photo < kPhotos; ++photo) {
      Image image(kWidth, kHeight, 3, light_from_display(level / 255.0f));
      for (int y = 10; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          for (int c = 0; c < 3; ++c) image.at(x, y, c) = scenery(photo, x, y);
        }
      }
      const std::string name = "photo_" + std::to_string(10 + photo) + ".exr";
      write_image(scratch / name, image);
      frames += std::string(photo > 0 ? ", " : "") + "{\"file_path\": \"" + name +
                "\", \"transform_matrix\": " + matrix_json(photo) + "}";
    }
    write_bytes(scratch / "transforms.json",
                "{\"camera_angle_x\": 0.8, \"frames\": [" + frames + "]}");
    CHECK(has_borders(scratch) == (level < 24.0f));
  }
}

TEST_CASE("two photos tell of no border, and cut-out ones have none") {
  const Scratch two;
  write_photos(two, bars, {.count = 2});
  CHECK_FALSE(has_borders(two));
  const Scratch cut;
  write_photos(cut, bars, {.channels = 4});
  DatasetOptions options;
  options.alpha = AlphaUse::kCutout;
  CHECK_FALSE(load_dataset(cut.path(), options).views.front().border);
}

TEST_CASE("each size of photos has a border of its own") {
  const Scratch scratch;
  write_photos(scratch, bars);
  for (int photo = 0; photo < kPhotos; photo += 2) {
    const std::string name = "photo_" + std::to_string(10 + photo) + ".png";
    Image image(2 * kWidth, 2 * kHeight, 3);
    for (int y = 0; y < image.height; ++y) {
      for (int x = 0; x < image.width; ++x) {
        for (int c = 0; c < 3; ++c) image.at(x, y, c) = scenery(photo, x, y);
      }
    }
    write_image(scratch / name, image);
  }
  const Dataset dataset = load_dataset(scratch.path());
  for (const View& view : dataset.views)
    CHECK((view.border != nullptr) == (view.source_camera.width == kWidth));
}
