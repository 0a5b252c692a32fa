// SPDX-License-Identifier: Apache-2.0
#include "eval/moving_areas.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <iterator>
#include <limits>
#include <optional>

#include "eval/metrics.hpp"
#include "eval/photo_agreement.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/view_axes.hpp"
#include "scene/even_choice.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/statistics.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr int kFits = 4;                // of the colours
constexpr double kLeastError = 0.03;    // below which pixels of a fit weigh the same
constexpr int kMaskSide = 384;          // pixels of a mask that is written
constexpr double kFar = 0.05;           // an error
constexpr double kVeryFar = 0.12;       // and one that others are joined to
constexpr double kTimesMedian = 3;      // of all errors: far; twice as much: very far
constexpr double kSameWay = 60;         // degrees between photos that see the same
constexpr std::size_t kWitnesses = 16;  // photos that are asked
constexpr std::size_t kFewWitnesses = 4;
constexpr double kAgree = 0.7;    // of those that see a place
constexpr double kHidden = 0.85;  // of the distance, of what is before a place
constexpr double kSky = 1e3;      // times the median depth: where nothing is

struct Size {
  int width, height;
};

// Calls visit(neighbour) for the pixels of 3 x 3 about one that are in the picture.
template <class Visit>
void for_neighbours(Size size, std::size_t pixel, const Visit& visit) {
  const int x = static_cast<int>(pixel) % size.width, y = static_cast<int>(pixel) / size.width;
  for (int j = std::max(y - 1, 0); j <= std::min(y + 1, size.height - 1); ++j) {
    for (int i = std::max(x - 1, 0); i <= std::min(x + 1, size.width - 1); ++i)
      visit(static_cast<std::size_t>(j) * static_cast<std::size_t>(size.width) +
            static_cast<std::size_t>(i));
  }
}

glm::dvec3 color_of(const Image& image, std::size_t pixel) {
  return {image.data[3 * pixel], image.data[3 * pixel + 1], image.data[3 * pixel + 2]};
}

// The picture with its colours as near to the photo's as an affine map brings them.
Image fitted(const Image& picture, const Image& photo, const Image& weight) {
  Image out = picture, kept = weight;
  for (int fit = 0; fit < kFits; ++fit) {
    for (std::size_t i = 0; i < photo.pixels(); ++i) {
      const glm::dvec3 miss = glm::abs(color_of(out, i) - color_of(photo, i));
      kept.data[i] =
          weight.data[i] / static_cast<float>(std::max({miss.x, miss.y, miss.z, kLeastError}));
    }
    out = color_corrected(picture, photo, kept);
  }
  return out;
}

Size size_of(const ComparedPhoto& photo) { return {photo.camera.width, photo.camera.height}; }

// Where what a pixel of the model shows is.
std::optional<glm::dvec3> place_of(const ComparedPhoto& photo, std::size_t pixel, double sky) {
  const int x = static_cast<int>(pixel) % photo.camera.width;
  const int y = static_cast<int>(pixel) / photo.camera.width;
  const CameraRay ray = camera_ray(photo.camera, x + 0.5, y + 0.5);
  if (!ray.valid) return std::nullopt;
  const auto depth = static_cast<double>(photo.depth[pixel]);
  if (!(depth > 0)) return ray.origin + sky * ray.direction;
  const double along =
      counts_along_ray(photo.camera) ? 1.0 : glm::dot(ray.direction, view_axis(photo.camera));
  return ray.origin + depth / along * ray.direction;
}

// The error of a photo where it sees a place; nothing where it does not.
std::optional<double> error_at(const ComparedPhoto& photo, const glm::dvec3& place, double sky) {
  const std::optional<glm::dvec2> point = project_into(photo.camera, place);
  if (!point) return std::nullopt;
  const int x = std::min(static_cast<int>(point->x), photo.camera.width - 1);
  const int y = std::min(static_cast<int>(point->y), photo.camera.height - 1);
  const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(photo.camera.width) +
                     static_cast<std::size_t>(x);
  const bool shows = photo.depth[pixel] > 0;
  const double own =
      shows ? depth_of(photo.camera, place) : glm::distance(place, photo.camera.center());
  const double depth = shows ? static_cast<double>(photo.depth[pixel]) : sky;
  if (std::isnan(photo.error[pixel]) || depth < kHidden * own) return std::nullopt;
  if (depth * kHidden > own) return std::numeric_limits<double>::infinity();
  return photo.error[pixel];
}

// Photos that see much of what one does, from near and far.
std::vector<std::size_t> witnesses_of(std::span<const PlacedPhoto> placed, std::size_t photo) {
  const std::vector<std::size_t> all = photos_beside(placed, photo, kSameWay, placed.size(),
                                                     std::numeric_limits<double>::infinity());
  std::vector<std::size_t> out = even_choice(all.size(), kWitnesses);
  for (std::size_t& i : out) i = all[i];
  return out;
}

// What photos that see a place say of one that is far from the model there.
enum class Verdict {
  kUnknown,  // few see it
  kAlone,    // most others are near
  kTogether
};

Verdict judged(std::span<const ComparedPhoto> photos,
               std::span<const std::size_t> witnesses,
               const glm::dvec3& place,
               double far,
               double sky) {
  std::size_t seen = 0, near = 0;
  for (const std::size_t witness : witnesses) {
    const std::optional<double> error = error_at(photos[witness], place, sky);
    if (!error) continue;
    ++seen;
    if (*error <= far) ++near;
  }
  if (seen < kFewWitnesses) return Verdict::kUnknown;
  return static_cast<double>(near) >= kAgree * static_cast<double>(seen) ? Verdict::kAlone
                                                                         : Verdict::kTogether;
}

// The pixels that `grows` joins to those of `seeds`, and those around them.
PixelMask joined(const PixelMask& seeds, const PixelMask& grows) {
  const Size size{seeds.width, seeds.height};
  PixelMask found = seeds;
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < pixel_count(size.width, size.height); ++i) {
    if (seeds[i]) open.push_back(i);
  }
  while (!open.empty()) {
    const std::size_t pixel = open.back();
    open.pop_back();
    for_neighbours(size, pixel, [&](std::size_t other) {
      if (!grows[other] || found[other]) return;
      found.set(other);
      open.push_back(other);
    });
  }
  PixelMask out = found;
  for (std::size_t i = 0; i < pixel_count(size.width, size.height); ++i) {
    if (found[i]) for_neighbours(size, i, [&](std::size_t other) { out.set(other); });
  }
  return out;
}

}  // namespace

std::vector<float> fitted_error(const Image& picture, const Image& photo, const Image& weight) {
  std::vector<float> out(photo.pixels(), std::numeric_limits<float>::quiet_NaN());
  const auto counts = [](float each) { return each > 0; };
  if (std::ranges::none_of(weight.data, counts)) return out;
  const Image nearest = fitted(picture, photo, weight);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!counts(weight.data[i])) continue;
    glm::dvec3 sum(0.0);
    double counted = 0;
    for_neighbours({photo.width, photo.height}, i, [&](std::size_t other) {
      const auto own = static_cast<double>(weight.data[other]);
      sum += own * (color_of(nearest, other) - color_of(photo, other));
      counted += own;
    });
    out[i] = static_cast<float>(std::sqrt(glm::dot(sum, sum) / 3) / counted);
  }
  return out;
}

std::vector<PixelMask> moving_areas(std::span<const ComparedPhoto> photos) {
  std::vector<PlacedPhoto> placed(photos.size());
  std::vector<double> errors, depths;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    placed[i].center = photos[i].camera.center();
    if (photos[i].camera.model != CameraModel::kEquirectangular)
      placed[i].direction = view_axis(photos[i].camera);
    std::ranges::copy_if(photos[i].error, std::back_inserter(errors),
                         [](float error) { return !std::isnan(error); });
    for (const float depth : photos[i].depth)
      if (depth > 0) depths.push_back(static_cast<double>(depth));
  }
  std::vector<PixelMask> out(photos.size());
  if (errors.empty()) return out;
  const double usual = median(std::move(errors));
  const double far = std::max(kFar, kTimesMedian * usual);
  const double very_far = std::max(kVeryFar, 2 * kTimesMedian * usual);
  const double sky = depths.empty() ? 1.0 : kSky * median(std::move(depths));
  in_parallel(photos.size(), [&](std::size_t i) {
    const ComparedPhoto& photo = photos[i];
    const std::vector<std::size_t> witnesses = witnesses_of(placed, i);
    PixelMask seeds(photo.camera.width, photo.camera.height), grows = seeds, alone = seeds;
    for (std::size_t pixel = 0; pixel < photo.error.size(); ++pixel) {
      if (!(photo.error[pixel] > far)) continue;
      const std::optional<glm::dvec3> place = place_of(photo, pixel, sky);
      if (!place) continue;
      const Verdict verdict = judged(photos, witnesses, *place, far, sky);
      if (verdict != Verdict::kTogether) grows.set(pixel);
      if (verdict == Verdict::kAlone) alone.set(pixel);
    }
    for (std::size_t pixel = 0; pixel < photo.error.size(); ++pixel) {
      if (!(photo.error[pixel] > very_far)) continue;
      bool inside = true;
      for_neighbours(size_of(photo), pixel,
                     [&](std::size_t other) { inside = inside && alone[other]; });
      if (inside) seeds.set(pixel);
    }
    out[i] = joined(seeds, grows);
  });
  return out;
}

Image counted_in_photo(const PixelMask& moving, const View& view) {
  Camera photo = view.source_camera;  // in the place of the view, whatever its own
  photo.rotation = view.camera.rotation;
  photo.translation = view.camera.translation;
  const double larger = static_cast<double>(std::max(photo.width, photo.height)) / kMaskSide;
  if (larger > 1) photo = downscaled(photo, larger);
  Image out(photo.width, photo.height, 1);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      out.at(x, y, 0) = 1.0f;
      const CameraRay ray = camera_ray(photo, x + 0.5, y + 0.5);
      if (!ray.valid) continue;
      const auto point = project_into(view.camera, ray.origin + ray.direction);
      if (!point) continue;
      const auto column = static_cast<int>(point->x / view.camera.width * moving.width);
      const auto row = static_cast<int>(point->y / view.camera.height * moving.height);
      const std::size_t pixel = pixel_count(moving.width, row) + static_cast<std::size_t>(column);
      if (moving[pixel]) out.at(x, y, 0) = 0.0f;
    }
  }
  return out;
}

}  // namespace raysplats
