// SPDX-License-Identifier: Apache-2.0
#include "eval/moving_areas.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "io/dataset/photo_views.hpp"
#include "io/photo/photo.hpp"
#include "raysplats/io.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/view_axes.hpp"
#include "unit/temporary_directory.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 60;
constexpr int kHeight = 40;
constexpr std::size_t kPixels = std::size_t{kWidth} * kHeight;

/// Cameras in front of the wall z = 0, which look at it from a little apart.
std::vector<Camera> before_wall(std::size_t count) {
  std::vector<Camera> out;
  for (std::size_t i = 0; i < count; ++i) {
    const double x = 0.6 * static_cast<double>(i) / static_cast<double>(count) - 0.3;
    out.push_back(
        look_at({x, 0.1 * std::cos(9 * x), -4}, {x / 2, 0, 0}, {0, 1, 0}, kWidth, kHeight, kWidth));
  }
  return out;
}

/// What a model that has the wall and nothing else knows: no error, and how far away it is.
ComparedPhoto wall_photo(const Camera& camera) {
  ComparedPhoto out{camera, std::vector<float>(kPixels), std::vector<float>(kPixels)};
  for (std::size_t i = 0; i < kPixels; ++i) {
    const CameraRay ray = camera_ray(camera, static_cast<double>(i % kWidth) + 0.5,
                                     static_cast<double>(i / kWidth) + 0.5);
    const double along = -ray.origin.z / ray.direction.z;
    out.depth[i] = static_cast<float>(along * glm::dot(ray.direction, view_axis(camera)));
  }
  return out;
}

struct Square {
  int left, top, side;

  bool holds(std::size_t pixel) const {
    const int x = static_cast<int>(pixel) % kWidth, y = static_cast<int>(pixel) / kWidth;
    return x >= left && x < left + side && y >= top && y < top + side;
  }
};

void add_error(ComparedPhoto& photo, const Square& square, float error) {
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (square.holds(i)) photo.error[i] = error;
  }
}

std::vector<ComparedPhoto> wall_photos(std::size_t count) {
  std::vector<ComparedPhoto> out;
  for (const Camera& camera : before_wall(count)) out.push_back(wall_photo(camera));
  return out;
}

/// Where the wall's point (x, y) is seen.
Square about(const Camera& camera, double x, double y, int side) {
  const auto place = project_into(camera, {x, y, 0});
  REQUIRE(place);
  return {static_cast<int>(place->x) - side / 2, static_cast<int>(place->y) - side / 2, side};
}

}  // namespace

TEST_CASE("a picture whose colours are an affine map of the photo's has no error") {
  CounterRng rng(3, 0);
  Image picture(kWidth, kHeight, 3), photo = picture;
  for (float& value : picture.data) value = static_cast<float>(rng.uniform());
  for (std::size_t i = 0; i < 3 * kPixels; i += 3) {
    const float r = picture.data[i], g = picture.data[i + 1], b = picture.data[i + 2];
    photo.data[i] = 0.7f * r + 0.1f * b + 0.05f;
    photo.data[i + 1] = 0.9f * g - 0.1f * r;
    photo.data[i + 2] = 0.5f * b + 0.2f;
  }
  const Image all(kWidth, kHeight, 1, 1.0f);
  for (const float error : fitted_error(picture, photo, all)) CHECK(error < 1e-4f);
}

TEST_CASE("a thing before a tenth of a photo has the error that it is, and all else next to none") {
  CounterRng rng(3, 1);
  Image picture(kWidth, kHeight, 3), weight(kWidth, kHeight, 1, 1.0f);
  for (float& value : picture.data) value = static_cast<float>(0.2 + 0.4 * rng.uniform());
  Image photo = picture;
  const Square thing{20, 10, 15};
  for (std::size_t i = 0; i < 3 * kPixels; ++i) photo.data[i] += thing.holds(i / 3) ? 0.3f : 0.0f;
  const std::vector<float> error = fitted_error(picture, photo, weight);
  const Square inside{21, 11, 13}, beside{19, 9, 17};
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (inside.holds(i)) CHECK(error[i] == doctest::Approx(0.3).epsilon(0.1));
    if (!beside.holds(i)) CHECK(error[i] < 0.02f);
  }
  // What does not count has none, and no say.
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (thing.holds(i)) weight.data[i] = 0.0f;
  }
  const std::vector<float> rest = fitted_error(picture, photo, weight);
  for (std::size_t i = 0; i < kPixels; ++i) {
    CHECK(std::isnan(rest[i]) == thing.holds(i));
    if (!thing.holds(i)) CHECK(rest[i] < 1e-4f);
  }
  const Image none(kWidth, kHeight, 1);
  for (const float each : fitted_error(picture, photo, none)) CHECK(std::isnan(each));
}

TEST_CASE("what one photo shows and others do not moves; what all lack does not") {
  std::vector<ComparedPhoto> photos = wall_photos(12);
  const Square thing{20, 12, 10};
  add_error(photos[3], thing, 0.2f);
  // A place that the model has wrong, in all photos.
  for (ComparedPhoto& photo : photos) add_error(photo, about(photo.camera, -0.6, 0.4, 9), 0.3f);
  const std::vector<PixelMask> found = moving_areas(photos);
  REQUIRE(found.size() == photos.size());
  const Square around{thing.left - 1, thing.top - 1, thing.side + 2};
  for (std::size_t i = 0; i < photos.size(); ++i) {
    INFO(i);
    if (i != 3) CHECK(count(found[i]) == 0);
  }
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel)
    CHECK(found[3][pixel] == around.holds(pixel));
}

TEST_CASE("small and faint errors are none of things that move, but for what is joined to one") {
  std::vector<ComparedPhoto> photos = wall_photos(12);
  add_error(photos[1], {5, 5, 2}, 0.5f);    // smaller than three pixels
  add_error(photos[2], {5, 5, 10}, 0.1f);   // faint
  add_error(photos[4], {20, 5, 10}, 0.1f);  // joined
  add_error(photos[4], {24, 9, 3}, 0.3f);
  add_error(photos[4], {40, 20, 10}, 0.1f);  // apart from it
  const std::vector<PixelMask> found = moving_areas(photos);
  CHECK(count(found[1]) == 0);
  CHECK(count(found[2]) == 0);
  CHECK(count(found[4]) == 12 * 12);
  // Where all is as far as that, nothing is.
  for (ComparedPhoto& photo : photos)
    for (float& error : photo.error) error = std::max(error, 0.06f);
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
}

TEST_CASE("what a model has before one camera alone is its fault, not the photo's") {
  std::vector<ComparedPhoto> photos = wall_photos(12);
  const Square floater{20, 12, 10};
  add_error(photos[3], floater, 0.3f);
  for (std::size_t i = 0; i < kPixels; ++i) {
    if (floater.holds(i)) photos[3].depth[i] = 2.0f;  // others look through it
  }
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
}

TEST_CASE("photos that do not count at a place say nothing of it") {
  const float unknown = std::numeric_limits<float>::quiet_NaN();
  std::vector<ComparedPhoto> photos = wall_photos(12);
  for (std::size_t i = 0; i < photos.size(); ++i)
    add_error(photos[i], about(photos[i].camera, 0, 0, 14), i == 5 ? 0.3f : unknown);
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
  // What errors usually are does not depend on how much of the photos counts.
  photos = wall_photos(12);
  for (ComparedPhoto& photo : photos) {
    for (std::size_t i = 0; i < kPixels; ++i)
      photo.error[i] = i % kWidth < kWidth / 2 ? 0.06f : unknown;
  }
  add_error(photos[2], {5, 5, 12}, 0.3f);
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
}

TEST_CASE("what passes before the sky is found wherever cameras are turned") {
  std::vector<ComparedPhoto> photos;
  for (int i = 0; i < 9; ++i) {
    const double turn = 0.17 * (i - 4);
    const Camera camera = look_at({0.1 * i, 0, 0}, {0.1 * i + std::sin(turn), 0, std::cos(turn)},
                                  {0, -1, 0}, kWidth, kHeight, 0.5 * kWidth);
    photos.push_back({camera, std::vector<float>(kPixels), std::vector<float>(kPixels)});
    // Something below the sky, so that there is a depth.
    std::fill(photos.back().depth.begin() + kPixels / 2, photos.back().depth.end(), 5.0f);
  }
  add_error(photos[4], {2, 4, 8}, 0.3f);
  add_error(photos[4], {30, 4, 8}, 0.3f);
  const std::vector<PixelMask> found = moving_areas(photos);
  for (std::size_t i = 0; i < photos.size(); ++i) CHECK(count(found[i]) == (i == 4 ? 200 : 0));
}

TEST_CASE("nothing moves where few photos see the place, nor among none") {
  std::vector<ComparedPhoto> photos = wall_photos(4);
  add_error(photos[1], {20, 12, 10}, 0.3f);
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
  CHECK(moving_areas({}).empty());
  // The same photo beside others that are hidden from the place by what is before them.
  photos = wall_photos(12);
  add_error(photos[1], {20, 12, 10}, 0.3f);
  CHECK(count(moving_areas(photos)[1]) > 0);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (i != 1) std::fill(photos[i].depth.begin(), photos[i].depth.end(), 1.0f);
  }
  for (const PixelMask& mask : moving_areas(photos)) CHECK(count(mask) == 0);
}

TEST_CASE("things that move are found by panoramas, and before a sky") {
  std::vector<ComparedPhoto> photos;
  for (int i = 0; i < 9; ++i) {
    Camera camera = look_at({0.1 * i, 0, 0}, {0.1 * i, 0, 1}, {0, -1, 0}, kWidth, kHeight, 20);
    set_equirectangular(camera);
    photos.push_back({camera, std::vector<float>(kPixels), std::vector<float>(kPixels, 5.0f)});
    for (std::size_t pixel = 0; pixel < kPixels / 2; ++pixel) photos.back().depth[pixel] = 0.0f;
  }
  add_error(photos[2], {10, 4, 8}, 0.3f);
  add_error(photos[6], {30, 26, 8}, 0.3f);
  const std::vector<PixelMask> found = moving_areas(photos);
  for (std::size_t i = 0; i < photos.size(); ++i)
    CHECK(count(found[i]) == (i == 2 || i == 6 ? 100 : 0));
}

TEST_CASE(
    "a mask of what moves leaves out the same, once it is read as a photo's, through lenses") {
  const TemporaryDirectory folder;
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye}) {
    INFO(static_cast<int>(model));
    Camera nominal = look_at({0.3, -0.2, -4}, {0, 0, 0}, {0, 1, 0}, 400, 300, 300);
    nominal.model = model;
    if (model == CameraModel::kOpenCv) nominal.distortion.k1 = -0.2;
    View view;
    view.image_path = folder / "photo.png";
    write_image(view.image_path, Image(400, 300, 3));
    io::set_cameras(view, nominal, {400, 300}, 2, true);
    const int width = view.camera.width, height = view.camera.height;
    // A thing at a corner, where a lens moves it most.
    PixelMask moving(width / 2, height / 2);
    const auto is_thing = [&](int x, int y) {
      return x < moving.width / 4 && y < moving.height / 3;
    };
    for (int y = 0; y < moving.height; ++y) {
      for (int x = 0; x < moving.width; ++x) {
        if (is_thing(x, y)) moving.set(pixel_count(moving.width, y) + static_cast<std::size_t>(x));
      }
    }
    view.mask_path = folder / "mask.png";
    write_image(view.mask_path, counted_in_photo(moving, view));
    const io::Photo photo = io::load_photo(view);
    int wrong = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x)
        wrong += (photo.at(x, y)[3] < 0.5f) != is_thing(x / 2, y / 2) ? 1 : 0;
    }
    CHECK(wrong < (width + height) / 4);  // of the pixels along the thing's two edges
  }
}
