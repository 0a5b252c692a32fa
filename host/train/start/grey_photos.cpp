// SPDX-License-Identifier: Apache-2.0
#include "train/start/grey_photos.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "scene/camera/view_axes.hpp"
#include "scene/statistics.hpp"
#include "train/capture_geometry.hpp"

namespace raysplats {
namespace {

// Differences of the largest and the least channel of a pixel: rounding leaves so much of grey
// ones, and from the second on colour is seen.
constexpr float kGrey = 2.5f / 255;
constexpr float kColored = 8.0f / 255;
// Of a photo's pixels, those that a grey photo may have with another colour (a compressed edge).
constexpr double kMostTinted = 0.001;
// Of the pixels of a photo with colours, those that have some: typical photos of unaltered captures
// have 0.45 and more (and each photo 0.28 and more that are not grey), those of a grey scene with a
// bright object less.
constexpr double kLeastColored = 0.2;
// What photos that lie next to grey ones have of it, at least, of what all have.
constexpr double kLeastNear = 0.5;
constexpr double kLeastContrast = 0.02;  // standard deviation of the brightness
constexpr std::size_t kLeastPixels = 50;

struct Colors {
  double tinted = 0;   // share of the pixels that are not grey
  double colored = 0;  // share of those with a colour that is seen
  bool tells = false;  // something is shown
  bool grey() const { return tells && tinted <= kMostTinted; }
};

Colors colors_of(const SmallPhoto& photo) {
  std::size_t count = 0, tinted = 0, colored = 0;
  double sum = 0, squares = 0;
  for (int y = 0; y < photo.picture->height; ++y) {
    for (int x = 0; x < photo.picture->width; ++x) {
      // Without the gain, which may have a colour of its own.
      const std::array<float, 4> rgba = photo.picture->at(x, y);
      if (rgba[3] < 0.5f || photo.picture->weight(x, y) < 0.5f) continue;
      const auto [least, most] = std::minmax({rgba[0], rgba[1], rgba[2]});
      const double light = static_cast<double>(rgba[0] + rgba[1] + rgba[2]) / 3;
      ++count;
      tinted += most - least > kGrey ? 1 : 0;
      colored += most - least > kColored ? 1 : 0;
      sum += light, squares += light * light;
    }
  }
  if (count < kLeastPixels) return {};
  const auto pixels = static_cast<double>(count);
  const double variance = squares / pixels - (sum / pixels) * (sum / pixels);
  return {static_cast<double>(tinted) / pixels, static_cast<double>(colored) / pixels,
          variance > kLeastContrast * kLeastContrast};
}

// How far apart two cameras stand and look, where the scene has that extent.
double apart(const Camera& a, const Camera& b, double extent) {
  return glm::distance(a.center(), b.center()) / extent + 1 - glm::dot(view_axis(a), view_axis(b));
}

}  // namespace

std::vector<std::size_t> grey_photos(std::span<const SmallPhoto> photos) {
  std::vector<std::size_t> grey, others;
  std::vector<double> shares;  // of all photos
  std::vector<double> of_others, of_neighbours;
  std::vector<Camera> cameras;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const Colors colors = colors_of(photos[i]);
    shares.push_back(colors.colored);
    cameras.push_back(photos[i].camera);
    if (!colors.tells) continue;
    (colors.grey() ? grey : others).push_back(i);
    if (!colors.grey()) of_others.push_back(colors.colored);
  }
  if (grey.empty() || others.empty()) return {};
  const double typical = median(of_others);
  if (typical < kLeastColored) return {};
  const double extent = camera_extent(cameras);
  for (const std::size_t i : grey) {
    const auto nearest =
        std::min_element(others.begin(), others.end(), [&](std::size_t a, std::size_t b) {
          return apart(cameras[a], cameras[i], extent) < apart(cameras[b], cameras[i], extent);
        });
    of_neighbours.push_back(shares[*nearest]);
  }
  if (median(std::move(of_neighbours)) < kLeastNear * typical) return {};
  return grey;
}

}  // namespace raysplats
