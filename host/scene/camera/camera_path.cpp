// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/camera_path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;
constexpr double kLeastGap = 1e-6;  // between knots of places that coincide
constexpr int kSpeedSteps = 64;     // straight pieces of a span whose length is measured

/// Between the second and the third of four places.
glm::dvec3 catmull_rom(const std::array<glm::dvec3, 4>& points, double t) {
  std::array<double, 4> knots{};
  for (std::size_t i = 1; i < 4; ++i) {
    const double gap = std::sqrt(glm::distance(points[i - 1], points[i]));
    knots[i] = knots[i - 1] + std::max(gap, kLeastGap);
  }
  const double at = knots[1] + t * (knots[2] - knots[1]);
  const auto mixed = [&](const glm::dvec3& a, const glm::dvec3& b, std::size_t i, std::size_t j) {
    return a + (at - knots[i]) / (knots[j] - knots[i]) * (b - a);
  };
  const glm::dvec3 a = mixed(points[0], points[1], 0, 1);
  const glm::dvec3 b = mixed(points[1], points[2], 1, 2);
  const glm::dvec3 c = mixed(points[2], points[3], 2, 3);
  return mixed(mixed(a, b, 0, 2), mixed(b, c, 1, 3), 1, 2);
}

glm::dmat3 turned(const glm::dmat3& from, const glm::dmat3& to, double share) {
  return glm::mat3_cast(
      glm::normalize(glm::slerp(glm::quat_cast(from), glm::quat_cast(to), share)));
}

/// A path with its keyframes by number, also beyond its ends.
class Track {
 public:
  explicit Track(const CameraPath& path) : path_(path) {}

  std::size_t spans() const { return path_.closed ? path_.keys.size() : path_.keys.size() - 1; }

  const Keyframe& key(std::ptrdiff_t i) const {
    const auto count = static_cast<std::ptrdiff_t>(path_.keys.size());
    const std::ptrdiff_t inside =
        path_.closed ? (i + count) % count : std::clamp<std::ptrdiff_t>(i, 0, count - 1);
    return path_.keys[static_cast<std::size_t>(inside)];
  }

  glm::dvec3 eye(std::size_t span, double t) const {
    const auto i = static_cast<std::ptrdiff_t>(span);
    return catmull_rom({place(i - 1), place(i), place(i + 1), place(i + 2)}, t);
  }

  Keyframe view(std::size_t span, double t) const {
    const auto i = static_cast<std::ptrdiff_t>(span);
    const Keyframe& a = key(i);
    const Keyframe& b = key(i + 1);
    return {eye(span, t), turned(a.axes, b.axes, t), a.fov + t * (b.fov - a.fov), a.seconds};
  }

 private:
  /// Beyond an end the path goes on as it came.
  glm::dvec3 place(std::ptrdiff_t i) const {
    const auto last = static_cast<std::ptrdiff_t>(path_.keys.size()) - 1;
    if (path_.closed || (i >= 0 && i <= last)) return key(i).eye;
    return i < 0 ? 2.0 * key(0).eye - key(1).eye : 2.0 * key(last).eye - key(last - 1).eye;
  }

  const CameraPath& path_;
};

/// Where along the spans equal steps are: ascending distances at known places, number of the span
/// plus share of it.
struct Ruler {
  std::vector<double> distances;
  std::vector<double> places;

  double place(double share) const {
    const double wanted = share * distances.back();
    const auto after = std::upper_bound(distances.begin(), distances.end(), wanted);
    if (after == distances.begin()) return places.front();
    if (after == distances.end()) return places.back();
    const auto j = static_cast<std::size_t>(after - distances.begin());
    const double gap = distances[j] - distances[j - 1];
    return places[j - 1] + (wanted - distances[j - 1]) / gap * (places[j] - places[j - 1]);
  }
};

Ruler by_seconds(const Track& track) {
  Ruler ruler{{0.0}, {0.0}};
  for (std::size_t span = 0; span < track.spans(); ++span) {
    ruler.distances.push_back(ruler.distances.back() +
                              track.key(static_cast<std::ptrdiff_t>(span)).seconds);
    ruler.places.push_back(static_cast<double>(span + 1));
  }
  return ruler;
}

Ruler by_length(const Track& track) {
  Ruler ruler{{0.0}, {0.0}};
  for (std::size_t span = 0; span < track.spans(); ++span) {
    glm::dvec3 before = track.eye(span, 0.0);
    for (int i = 1; i <= kSpeedSteps; ++i) {
      const double t = static_cast<double>(i) / kSpeedSteps;
      const glm::dvec3 here = track.eye(span, t);
      ruler.distances.push_back(ruler.distances.back() + glm::distance(before, here));
      ruler.places.push_back(static_cast<double>(span) + t);
      before = here;
    }
  }
  return ruler;
}

}  // namespace

std::vector<Keyframe> path_views(const CameraPath& path, int frames) {
  if (path.keys.empty()) throw UsageError("A camera path without keyframes leads nowhere");
  if (frames < 1)
    throw UsageError(fmt::format("A camera path cannot have {} frames: use 1 or more", frames));
  const auto count = static_cast<std::size_t>(frames);
  if (path.keys.size() == 1) return std::vector<Keyframe>(count, path.keys.front());
  const Track track(path);
  Ruler ruler = path.constant_speed ? by_length(track) : by_seconds(track);
  // A path that turns on the spot has no length.
  if (!(ruler.distances.back() > 0.0)) ruler = by_seconds(track);
  // One without seconds takes the same time for each of its spans.
  if (!(ruler.distances.back() > 0.0)) ruler.distances = ruler.places;
  const double steps = path.closed ? frames : std::max(frames - 1, 1);
  std::vector<Keyframe> views;
  views.reserve(count);
  for (int i = 0; i < frames; ++i) {
    const double place = ruler.place(i / steps);
    const auto span = std::min(static_cast<std::size_t>(place), track.spans() - 1);
    views.push_back(track.view(span, place - static_cast<double>(span)));
  }
  return views;
}

Keyframe keyframe_of(const Camera& camera) {
  return {camera.center(), glm::transpose(camera.rotation),
          2.0 * std::atan(0.5 * camera.height / camera.fy) / kRadians, 1.0};
}

Camera camera_of(const Keyframe& key, int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * key.fov * kRadians);
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.rotation = glm::transpose(key.axes);
  camera.translation = -(camera.rotation * key.eye);
  return camera;
}

Camera between(const Camera& from, const Camera& to, double share) {
  Camera camera = from;
  // Pixels of pictures of another size, or through another lens, are other measures.
  if (from.model == to.model && from.width == to.width && from.height == to.height &&
      from.distortion == to.distortion) {
    // A zoom that went on would reach focal lengths below 0.
    const double inside = std::clamp(share, 0.0, 1.0);
    const auto mixed = [inside](double a, double b) { return a + inside * (b - a); };
    camera.fx = mixed(from.fx, to.fx);
    camera.fy = mixed(from.fy, to.fy);
    camera.cx = mixed(from.cx, to.cx);
    camera.cy = mixed(from.cy, to.cy);
  }
  const glm::dvec3 eye = from.center() + share * (to.center() - from.center());
  camera.rotation =
      glm::transpose(turned(glm::transpose(from.rotation), glm::transpose(to.rotation), share));
  camera.translation = -(camera.rotation * eye);
  return camera;
}

}  // namespace raysplats
