// SPDX-License-Identifier: Apache-2.0
#include "train/photo_set.hpp"

#include <algorithm>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <numeric>

#include "core/camera_model.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kColorBins = 32;  // per channel
constexpr double kSharedColor = 0.2;    // share of the pixels that makes a colour the ground's

double channel(std::uint32_t pixel, int index) {
  return static_cast<double>(pixel >> (8 * index) & 255u) / 255.0;
}

}  // namespace

glm::dvec4 SmallPhoto::at(const glm::dvec2& point) const {
  const auto x = static_cast<std::size_t>(std::clamp<double>(point.x, 0, picture->width - 1));
  const auto y = static_cast<std::size_t>(std::clamp<double>(point.y, 0, picture->height - 1));
  const std::uint32_t pixel = picture->pixels[y * static_cast<std::size_t>(picture->width) + x];
  return {channel(pixel, 0), channel(pixel, 1), channel(pixel, 2), channel(pixel, 3)};
}

bool SmallPhoto::known(const glm::dvec2& point) const {
  if (picture->weights.empty()) return true;
  const auto x = static_cast<std::size_t>(std::clamp<double>(point.x, 0, picture->width - 1));
  const auto y = static_cast<std::size_t>(std::clamp<double>(point.y, 0, picture->height - 1));
  return picture->weights[y * static_cast<std::size_t>(picture->width) + x] >= 128;
}

std::optional<glm::dvec2> SmallPhoto::sees(const glm::dvec3& world) const {
  const std::optional<glm::dvec2> point = project(camera, world);
  if (!point ||
      !(point->x >= 0 && point->x < camera.width && point->y >= 0 && point->y < camera.height)) {
    return std::nullopt;
  }
  return point;
}

std::vector<SmallPhoto> load_small_photos(const Dataset& dataset,
                                          std::span<const std::size_t> views,
                                          int longest) {
  std::vector<View> small;
  small.reserve(views.size());
  for (const std::size_t index : views) {
    View view = dataset.views[index];
    const int side = std::max(view.camera.width, view.camera.height);
    if (side > longest) view.camera = downscaled(view.camera, static_cast<double>(side) / longest);
    small.push_back(std::move(view));
  }
  std::vector<SmallPhoto> out(small.size());
  for (std::size_t i = 0; i < small.size(); ++i) out[i].camera = small[i].camera;
  io::ViewLoader loader(std::move(small), std::numeric_limits<std::size_t>::max());
  std::vector<std::size_t> all(out.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  loader.prefetch(all);
  for (std::size_t i = 0; i < out.size(); ++i) out[i].picture = loader.get(i);
  return out;
}

double opaque_share(std::span<const SmallPhoto> photos) {
  double sum = 0;
  for (const SmallPhoto& photo : photos) {
    const auto& pixels = photo.picture->pixels;
    const auto opaque = std::count_if(pixels.begin(), pixels.end(),
                                      [](std::uint32_t pixel) { return pixel >> 24 >= 128; });
    sum +=
        static_cast<double>(opaque) / static_cast<double>(std::max<std::size_t>(pixels.size(), 1));
  }
  return photos.empty() ? 1.0 : sum / static_cast<double>(photos.size());
}

std::array<float, 3> typical_color(std::span<const SmallPhoto> photos) {
  struct Sum {
    std::array<double, 3> color{};
    double weight = 0;
    void add(std::uint32_t pixel) {
      const double share = channel(pixel, 3);
      for (int c = 0; c < 3; ++c) color[static_cast<std::size_t>(c)] += share * channel(pixel, c);
      weight += share;
    }
  };
  Sum all;
  std::vector<Sum> bins(kColorBins * kColorBins * kColorBins);
  for (const SmallPhoto& photo : photos) {
    for (const std::uint32_t pixel : photo.picture->pixels) {
      all.add(pixel);
      const std::size_t bin = ((pixel >> 3 & 31u) * kColorBins + (pixel >> 11 & 31u)) * kColorBins +
                              (pixel >> 19 & 31u);
      bins[bin].add(pixel);
    }
  }
  const auto most = std::max_element(
      bins.begin(), bins.end(), [](const Sum& a, const Sum& b) { return a.weight < b.weight; });
  const Sum& chosen = most->weight >= kSharedColor * all.weight ? *most : all;
  std::array<float, 3> out{};
  if (chosen.weight == 0) return out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<float>(chosen.color[c] / chosen.weight);
  return out;
}

}  // namespace raysplats
