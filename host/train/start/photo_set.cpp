// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_set.hpp"

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <numeric>

#include "io/photo/view_loader.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"
#include "util/clock.hpp"
#include "util/progress.hpp"

namespace raysplats {
namespace {

constexpr float kOpaque = 0.5f;  // what pixels at a body's outline have in the mean

constexpr std::size_t kColorBins = 32;  // per channel
constexpr double kSharedColor = 0.2;    // share of the pixels that makes a colour the ground's

constexpr double kLookSeconds = 0.5;  // between two looks at how far reading is

// What a few specks show sets no range, but lamps at night do.
constexpr std::array<double, 2> kColorEnds{0.001, 0.999};

// One of kColorBins steps along a channel.
std::size_t bin_of(float value) {
  return std::min(kColorBins - 1, static_cast<std::size_t>(value * kColorBins));
}

template <class Take>
void for_each_pixel(const SmallPhoto& photo, const Take& take) {
  for (int y = 0; y < photo.picture->height; ++y) {
    for (int x = 0; x < photo.picture->width; ++x) take(photo.color(x, y));
  }
}

// Colours weighted by their alpha.
struct ColorSum {
  std::array<double, 3> color{};
  double weight = 0;
  void add(const std::array<float, 4>& rgba) {
    const auto share = static_cast<double>(rgba[3]);
    for (std::size_t c = 0; c < 3; ++c) color[c] += share * static_cast<double>(rgba[c]);
    weight += share;
  }
};

// Mean share of the pixels of which it holds.
template <class Holds>
double mean_share(std::span<const SmallPhoto> photos, const Holds& holds) {
  double sum = 0;
  for (const SmallPhoto& photo : photos) {
    std::size_t count = 0;
    for (int y = 0; y < photo.picture->height; ++y) {
      for (int x = 0; x < photo.picture->width; ++x) count += holds(photo, x, y) ? 1 : 0;
    }
    const std::size_t pixels = std::max<std::size_t>(photo.picture->pixels(), 1);
    sum += static_cast<double>(count) / static_cast<double>(pixels);
  }
  return photos.empty() ? 1.0 : sum / static_cast<double>(photos.size());
}

}  // namespace

bool SmallPhoto::known(const glm::dvec2& point) const {
  const glm::ivec2 pixel = pixel_of(point);
  return picture->weight(pixel.x, pixel.y) >= 0.5f;
}

std::optional<glm::dvec2> SmallPhoto::sees(const glm::dvec3& world) const {
  return project_into(camera, world);
}

std::vector<SmallPhoto> load_small_photos(const Dataset& dataset,
                                          std::span<const std::size_t> views,
                                          int longest,
                                          const ReadingProgress& progress) {
  const auto start = std::chrono::steady_clock::now();
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
  std::optional<Progress> bar;
  const auto show = [&](std::size_t done) {
    if (progress.stream == nullptr) return;
    const auto steps = static_cast<std::int64_t>(done);
    if (!bar && done < out.size() && seconds_since(start) >= progress.after) {
      bar.emplace("Reading photos", static_cast<std::int64_t>(out.size()), steps, progress.stream);
    }
    if (bar) bar->update(steps, "");
  };
  for (std::size_t i = 0; i < out.size(); ++i) {
    while (!loader.wait(i, kLookSeconds)) show(i);
    out[i].picture = loader.get(i);
    show(i + 1);
  }
  if (bar) bar->suspend();  // a terminal goes on without it
  return out;
}

void balance(std::span<SmallPhoto> photos) {
  constexpr double kDark = 1e-3;  // a mean that says nothing of a gain
  std::vector<ColorSum> sums(photos.size());
  std::array<double, 3> all{};
  std::size_t counted = 0;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    for_each_pixel(photos[i], [&](const std::array<float, 4>& rgba) { sums[i].add(rgba); });
    if (sums[i].weight == 0) continue;
    ++counted;
    for (std::size_t c = 0; c < 3; ++c) all[c] += sums[i].color[c] / sums[i].weight;
  }
  for (std::size_t i = 0; i < photos.size(); ++i) {
    for (std::size_t c = 0; c < 3 && sums[i].weight > 0; ++c) {
      const double mean = sums[i].color[c] / sums[i].weight;
      if (mean < kDark) continue;
      photos[i].gain[c] *= static_cast<float>(all[c] / static_cast<double>(counted) / mean);
    }
  }
}

bool SmallPhoto::shows_body(int x, int y) const {
  const float alpha = picture->at(x, y)[3];
  if (alpha >= kOpaque || alpha <= kLeastAlpha) return alpha >= kOpaque;
  for (int v = std::max(y - 1, 0); v <= std::min(y + 1, picture->height - 1); ++v) {
    for (int u = std::max(x - 1, 0); u <= std::min(x + 1, picture->width - 1); ++u) {
      if (picture->at(u, v)[3] <= kLeastAlpha) return false;
    }
  }
  return true;
}

double opaque_share(std::span<const SmallPhoto> photos) {
  return mean_share(photos, [](const SmallPhoto& photo, int x, int y) {
    return photo.picture->at(x, y)[3] >= kOpaque;
  });
}

double body_share(std::span<const SmallPhoto> photos) {
  return mean_share(photos,
                    [](const SmallPhoto& photo, int x, int y) { return photo.shows_body(x, y); });
}

bool shows_anything(std::span<const SmallPhoto> photos) {
  return std::any_of(photos.begin(), photos.end(), [](const SmallPhoto& photo) {
    for (int y = 0; y < photo.picture->height; ++y) {
      for (int x = 0; x < photo.picture->width; ++x) {
        if (photo.picture->at(x, y)[3] > 0) return true;
      }
    }
    return false;
  });
}

std::array<float, 3> typical_color(std::span<const SmallPhoto> photos) {
  ColorSum all;
  std::vector<ColorSum> bins(kColorBins * kColorBins * kColorBins);
  for (const SmallPhoto& photo : photos) {
    for_each_pixel(photo, [&](const std::array<float, 4>& rgba) {
      all.add(rgba);
      bins[(bin_of(rgba[0]) * kColorBins + bin_of(rgba[1])) * kColorBins + bin_of(rgba[2])].add(
          rgba);
    });
  }
  const auto most =
      std::max_element(bins.begin(), bins.end(),
                       [](const ColorSum& a, const ColorSum& b) { return a.weight < b.weight; });
  const ColorSum& chosen = most->weight >= kSharedColor * all.weight ? *most : all;
  std::array<float, 3> out{};
  if (chosen.weight == 0) return out;
  for (std::size_t c = 0; c < 3; ++c) out[c] = static_cast<float>(chosen.color[c] / chosen.weight);
  return out;
}

double color_range(std::span<const SmallPhoto> photos) {
  std::array<std::vector<double>, 3> channels;
  for (const SmallPhoto& photo : photos) {
    for (int y = 0; y < photo.picture->height; ++y) {
      for (int x = 0; x < photo.picture->width; ++x) {
        const std::array<float, 4> rgba = photo.color(x, y);
        if (!photo.shows_body(x, y) || photo.picture->weight(x, y) < 0.5f) continue;
        for (std::size_t c = 0; c < 3; ++c) channels[c].push_back(static_cast<double>(rgba[c]));
      }
    }
  }
  double range = 1.0 / 255;
  for (std::vector<double>& channel : channels) {
    const std::vector<double> ends = quantiles(std::move(channel), kColorEnds);
    range = std::max(range, ends[1] - ends[0]);
  }
  return range;
}

}  // namespace raysplats
