// SPDX-License-Identifier: Apache-2.0
#include "train/crowded_places.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <utility>

#include "scene/camera/view_axes.hpp"
#include "scene/statistics.hpp"

namespace raysplats {
namespace {

constexpr double kApart = 0.01;  // of the distance to what a photo shows
constexpr double kDegrees = 3;
constexpr double kTimesMedian = 4;

}  // namespace

bool from_one_place(const Camera& a, const Camera& b, double distance) {
  const auto is_panorama = [](const Camera& camera) {
    return camera.model == CameraModel::kEquirectangular;
  };
  if (is_panorama(a) != is_panorama(b)) return false;
  if (glm::distance(a.center(), b.center()) > kApart * distance) return false;
  return is_panorama(a) || glm::dot(view_axis(a), view_axis(b)) >= std::cos(glm::radians(kDegrees));
}

CrowdedPlaces crowded_places(std::span<const Camera> cameras, std::span<const double> distances) {
  std::vector<CrowdedPlace> places;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const auto holds = [&](const CrowdedPlace& place) {
      return from_one_place(cameras[place.photos.front()], cameras[i], place.distance);
    };
    const auto found = std::find_if(places.begin(), places.end(), holds);
    if (found != places.end()) {
      found->photos.push_back(i);
    } else {
      places.push_back({{i}, distances[i]});
    }
  }
  CrowdedPlaces out;
  if (places.empty()) return out;
  std::vector<double> sizes;
  sizes.reserve(places.size());
  for (const CrowdedPlace& place : places)
    sizes.push_back(static_cast<double>(place.photos.size()));
  out.most = static_cast<std::size_t>(std::ceil(kTimesMedian * median(std::move(sizes))));
  std::erase_if(places, [&](const CrowdedPlace& place) { return place.photos.size() <= out.most; });
  out.places = std::move(places);
  return out;
}

}  // namespace raysplats
