// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_rows.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>

#include "raysplats/dataset.hpp"
#include "scene/camera/camera_model.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

/// A picture of floats as a file has it.
io::RawImage raw(const Image& image) {
  return {image.width, image.height, image.channels, image.data};
}

Image collected(io::PhotoRows& rows) {
  Image out(rows.width(), rows.height(), 4);
  for (int y = 0; y < out.height; ++y) rows.row(y, &out.at(0, y, 0));
  return out;
}

Image reduced(const Image& image, int width, int height) {
  const io::RawImage source = raw(image);
  return collected(*io::reduced_rows(io::decoded_rows(source, nullptr), width, height));
}

Image undistorted(const Image& image, const Camera& camera) {
  const io::RawImage source = raw(image);
  return collected(*io::undistorted_rows(io::decoded_rows(source, nullptr), camera));
}

Image seen(const Image& image, const Camera& camera) {
  const io::RawImage source = raw(image);
  return collected(*io::seen_rows(io::decoded_rows(source, nullptr), camera));
}

/// Average of premultiplied colour and of alpha over a target pixel, straight, by overlap areas in
/// double.
void box_reference(const Image& image, int width, int height, int x, int y, double out[4]) {
  const double x0 = static_cast<double>(x) * image.width / width;
  const double x1 = static_cast<double>(x + 1) * image.width / width;
  const double y0 = static_cast<double>(y) * image.height / height;
  const double y1 = static_cast<double>(y + 1) * image.height / height;
  double sum[4] = {};
  for (int j = 0; j < image.height; ++j) {
    for (int i = 0; i < image.width; ++i) {
      const double overlap = std::max(0.0, std::min(x1, i + 1.0) - std::max(x0, double(i))) *
                             std::max(0.0, std::min(y1, j + 1.0) - std::max(y0, double(j)));
      const double alpha = static_cast<double>(image.at(i, j, 3));
      for (int c = 0; c < 3; ++c)
        sum[c] += overlap * alpha * static_cast<double>(image.at(i, j, c));
      sum[3] += overlap * alpha;
    }
  }
  for (int c = 0; c < 3; ++c) out[c] = sum[3] > 0 ? sum[c] / sum[3] : 0.0;
  out[3] = sum[3] / ((x1 - x0) * (y1 - y0));
}

/// A smooth pattern over the plane of the undistorted camera, in pixels.
double pattern(double u, double v, int channel) {
  return 0.5 + 0.4 * std::sin(2 * std::numbers::pi * (u / 60.0 + 0.3 * channel)) *
                   std::cos(2 * std::numbers::pi * v / 45.0);
}

/// Undistorted normalised point of a distorted one by fixed-point iteration.
void undistorted_point(const Distortion& d, double dx, double dy, double& x, double& y) {
  x = dx;
  y = dy;
  for (int i = 0; i < 200; ++i) {
    const glm::dvec2 p = distort(d, {x, y});
    x += dx - p.x;
    y += dy - p.y;
  }
}

}  // namespace

TEST_CASE("area resampling equals the overlap-weighted average for whole and fractional factors") {
  CounterRng rng(5, 6);
  Image image(23, 17, 4);
  for (float& value : image.data) value = static_cast<float>(rng.uniform());
  for (std::size_t i = 0; i < image.pixels(); i += 3) image.data[4 * i + 3] = 0.0f;
  for (const auto& [width, height] :
       {std::pair{23, 17}, {11, 8}, {8, 6}, {5, 17}, {1, 1}, {22, 16}}) {
    const Image out = reduced(image, width, height);
    double worst = 0;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        double expected[4];
        box_reference(image, width, height, x, y, expected);
        // Without resampling the colour of a transparent pixel stays what it is.
        for (int c = expected[3] > 0 ? 0 : 3; c < 4; ++c) {
          worst = std::max(worst, std::abs(static_cast<double>(out.at(x, y, c)) - expected[c]));
        }
      }
    }
    CHECK(worst < 1e-5);
  }
}

TEST_CASE("reduction of 8 and 16 bits works on unrounded sums") {
  CounterRng rng(6, 6);
  for (const int width : {31, 40}) {
    Image image(width, 26, 4);
    io::RawImage bytes{width, 26, 4, std::vector<std::uint8_t>(image.data.size())};
    io::RawImage shorts{width, 26, 4, std::vector<std::uint16_t>(image.data.size())};
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      const auto byte = static_cast<std::uint8_t>(rng.below(256));
      std::get<std::vector<std::uint8_t>>(bytes.numbers)[i] = byte;
      std::get<std::vector<std::uint16_t>>(shorts.numbers)[i] =
          static_cast<std::uint16_t>(257u * byte);
      image.data[i] = static_cast<float>(byte) / 255.0f;
    }
    for (const io::RawImage* source : {&bytes, &shorts}) {
      const Image out = collected(*io::reduced_rows(io::decoded_rows(*source, nullptr), 9, 5));
      double worst = 0;
      for (int y = 0; y < 5; ++y) {
        for (int x = 0; x < 9; ++x) {
          double expected[4];
          box_reference(image, 9, 5, x, y, expected);
          for (int c = 0; c < 4; ++c)
            worst = std::max(worst, std::abs(static_cast<double>(out.at(x, y, c)) - expected[c]));
        }
      }
      CHECK(worst < 2e-6);
    }
  }
}

TEST_CASE("a mask of another size is taken at the centres of a photo's pixels") {
  io::MaskPlane mask{8, 4, {}};
  for (int i = 0; i < 32; ++i) mask.values.push_back(static_cast<float>(i));
  // Centres 1, 3, 5 of 6 lie in columns 1, 4 and 6 of 8; 1 and 3 of 4 in rows 1 and 3.
  const Image out = collected(*io::mask_rows(mask, 3, 2));
  const int expected[] = {9, 12, 14, 25, 28, 30};
  for (int i = 0; i < 6; ++i) CHECK(out.at(i % 3, i / 3, 3) == static_cast<float>(expected[i]));
  const Image large = collected(*io::mask_rows(mask, 16, 8));
  for (int x = 0; x < 16; ++x) CHECK(large.at(x, 2, 3) == static_cast<float>(8 + x / 2));
}

TEST_CASE("transparent pixels do not bleed into the average") {
  Image image(2, 1, 4);
  image.data = {1.0f, 0.5f, 0.25f, 1.0f, 0.0f, 0.0f, 0.0f, 0.0f};
  const Image out = reduced(image, 1, 1);
  CHECK(out.data == std::vector<float>{1.0f, 0.5f, 0.25f, 0.5f});
}

TEST_CASE("undistortion recovers an analytic pattern seen through a lens") {
  Camera camera;
  camera.width = 180;
  camera.height = 140;
  camera.fx = 150;
  camera.fy = 155;
  camera.cx = 86.5;
  camera.cy = 71.25;
  camera.model = CameraModel::kOpenCv;
  for (const Distortion& d :
       {Distortion{0.12, -0.05, 0.0, 0.002, -0.003}, Distortion{-0.15, 0.03, 0.01, 0.0, 0.0}}) {
    // The photo: each pixel shows the pattern where the undistorted ray of its distorted position
    // goes.
    Image photo(camera.width, camera.height, 4, 1.0f);
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        double ux = 0;
        double uy = 0;
        undistorted_point(d, (x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy,
                          ux, uy);
        for (int c = 0; c < 3; ++c) {
          photo.at(x, y, c) = static_cast<float>(
              pattern(ux * camera.fx + camera.cx, uy * camera.fy + camera.cy, c));
        }
      }
    }
    camera.distortion = d;
    const Image out = undistorted(photo, camera);
    double worst = 0;
    double worst_unchanged = 0;
    std::size_t inside = 0;
    std::size_t masked = 0;
    std::size_t wrong_alpha = 0;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const glm::dvec2 seen =
            distort(d, {(x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy});
        const double u = seen.x * camera.fx + camera.cx;
        const double v = seen.y * camera.fy + camera.cy;
        const bool in_photo = u >= 0 && u <= camera.width && v >= 0 && v <= camera.height;
        wrong_alpha += std::abs(out.at(x, y, 3) - (in_photo ? 1.0f : 0.0f)) > 1e-6f ? 1 : 0;
        masked += in_photo ? 0 : 1;
        if (u < 1 || u > camera.width - 1 || v < 1 || v > camera.height - 1) continue;
        ++inside;
        for (int c = 0; c < 3; ++c) {
          const double expected = pattern(x + 0.5, y + 0.5, c);
          worst = std::max(worst, std::abs(static_cast<double>(out.at(x, y, c)) - expected));
          worst_unchanged = std::max(worst_unchanged,
                                     std::abs(static_cast<double>(photo.at(x, y, c)) - expected));
        }
      }
    }
    // Bilinear interpolation errs by at most |f''| / 8 per axis, here 0.004.
    CHECK(worst < 0.005);
    CHECK(worst_unchanged > 0.1);
    CHECK(wrong_alpha == 0);
    CHECK(inside > 20000);
    if (d.k1 > 0) CHECK(masked > 100);
  }
}

TEST_CASE("rays beyond the angle where the lens folds over are masked") {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = 40;
  camera.cx = camera.cy = 50;
  // r (1 - r^2 / 3) grows up to r = 1 and comes back into the photo beyond.
  camera.model = CameraModel::kOpenCv;
  camera.distortion = {-1.0 / 3.0, 0, 0, 0, 0};
  const Image out = undistorted(Image(100, 100, 4, 1.0f), camera);
  std::size_t wrong = 0;
  for (int y = 0; y < 100; ++y) {
    for (int x = 0; x < 100; ++x) {
      const double r = std::hypot(x + 0.5 - 50, y + 0.5 - 50) / 40;
      if (std::abs(r - 1) > 1e-3 && std::abs(out.at(x, y, 3) - (r < 1 ? 1.0f : 0.0f)) > 1e-6f)
        ++wrong;
    }
  }
  CHECK(wrong == 0);
}

TEST_CASE("pixels that a lens does not see are masked in photos that keep their model") {
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = 15;
  camera.cx = 48;
  camera.cy = 50;
  camera.model = CameraModel::kFisheye;
  for (const double k4 : {0.0, -0.001}) {
    camera.distortion.k4 = k4;
    const Image photo = seen(Image(100, 100, 4, 0.75f), camera);
    std::size_t wrong = 0, masked = 0;
    for (int y = 0; y < 100; ++y) {
      for (int x = 0; x < 100; ++x) {
        const bool valid = camera_ray(camera, x + 0.5, y + 0.5).valid;
        masked += valid ? 0 : 1;
        wrong += photo.at(x, y, 3) == (valid ? 0.75f : 0.0f) && photo.at(x, y, 0) == 0.75f ? 0 : 1;
      }
    }
    CHECK(wrong == 0);
    CHECK(masked > 1000);
  }
  camera.model = CameraModel::kPinhole;
  const Image photo(100, 100, 4, 0.75f);
  CHECK(seen(photo, camera).data == photo.data);
}

TEST_CASE("compositing blends by alpha and repeats grey") {
  const float background[3] = {1.0f, 0.5f, 0.0f};
  Image rgba(1, 1, 4);
  rgba.data = {0.2f, 0.4f, 0.6f, 0.25f};
  const Image out = composite(rgba, background);
  REQUIRE(out.channels == 3);
  CHECK(out.data[0] == doctest::Approx(0.8));
  CHECK(out.data[1] == doctest::Approx(0.475));
  CHECK(out.data[2] == doctest::Approx(0.15));
  CHECK(composite(Image(1, 1, 1, 0.3f), background).data == std::vector<float>{0.3f, 0.3f, 0.3f});
  CHECK(composite(Image(1, 1, 3, 0.3f), background).data == std::vector<float>{0.3f, 0.3f, 0.3f});
  Image short_one(2, 2, 4);
  short_one.data.pop_back();
  CHECK_THROWS_AS(composite(short_one, background), UsageError);
}
