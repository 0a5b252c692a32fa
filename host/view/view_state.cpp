// SPDX-License-Identifier: Apache-2.0
#include "view/view_state.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <vector>

#include "util/json_text.hpp"

namespace raysplats::view {
namespace {

using Json = nlohmann::json;

constexpr double kLeastFov = 1.0;
constexpr double kMostFov = 120.0;  // of the page's slider

Json vector_json(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

Json pose_json(const Camera& camera) {
  const glm::dmat3 axes = glm::transpose(camera.rotation);
  const glm::dvec3 eye = camera.center();
  Json out = Json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) out.push_back(axes[column][row]);
    out.push_back(eye[row]);
  }
  return out;
}

/// The angle of view along the picture's height, in degrees. Lenses without a focal length that
/// says it get the page's largest.
double vertical_fov(const Camera& camera) {
  const bool angle = camera.model == CameraModel::kPinhole ||
                     camera.model == CameraModel::kOpenCv || camera.model == CameraModel::kFisheye;
  if (!angle || !(camera.fy > 0.0)) return kMostFov;
  const double degrees =
      2.0 * std::atan(0.5 * camera.height / camera.fy) * 180.0 / std::numbers::pi;
  return std::clamp(degrees, kLeastFov, kMostFov);
}

/// `photo`: whether its photo lies over what the page's pinhole sees from there; `shift` is how far
/// its middle is off that of the picture, in heights of the photo.
Json camera_json(const Camera& camera, bool photos) {
  const double height = std::max(camera.height, 1);
  const bool flat = photos && camera.model == CameraModel::kPinhole && !camera.distortion.any() &&
                    camera.fx > 0.0;
  Json json{{"name", camera.name},
            {"c2w", pose_json(camera)},
            {"fov", vertical_fov(camera)},
            {"aspect", static_cast<double>(camera.width) / height},
            {"photo", flat}};
  if (!flat) return json;
  // Pixels that are no squares are drawn as what they see.
  const double stretch = camera.fy / camera.fx;
  json["aspect"] = stretch * static_cast<double>(camera.width) / height;
  json["shift"] = {stretch * (0.5 * camera.width - camera.cx) / height,
                   (0.5 * camera.height - camera.cy) / height};
  return json;
}

}  // namespace

ViewState first_look(const SceneExtent& extent,
                     std::span<const Camera> cameras,
                     const std::optional<glm::dvec3>& up) {
  ViewState state;
  state.cameras = cameras;
  state.extent = extent;
  state.extent.center = common_target(cameras).value_or(extent.center);
  state.up = up.value_or(estimate_up(cameras));
  OrbitOptions orbit;
  orbit.up = state.up;
  state.start = cameras.empty() ? orbit_cameras(state.extent, orbit).front() : cameras.front();
  return state;
}

SceneExtent extent_before(std::span<const Camera> cameras) {
  SceneExtent extent;
  if (cameras.empty()) return extent;
  glm::dvec3 middle(0.0);
  for (const Camera& camera : cameras) middle += camera.center();
  middle /= static_cast<double>(cameras.size());
  extent.center = common_target(cameras).value_or(middle);
  std::vector<double> distances;
  for (const Camera& camera : cameras)
    distances.push_back(glm::distance(camera.center(), extent.center));
  const auto median = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), median, distances.end());
  if (*median > 0.0) extent.radius = *median;
  return extent;
}

std::string state_json(const ViewState& state) {
  Json cameras = Json::array();
  for (const Camera& camera : state.cameras)
    cameras.push_back(camera_json(camera, state.has_photos));
  const Json json{{"version", RAYSPLATS_VERSION},
                  {"name", state.name},
                  {"about", state.about},
                  {"center", vector_json(state.extent.center)},
                  {"radius", state.extent.radius},
                  {"origin", vector_json(state.origin)},
                  {"up", vector_json(state.up)},
                  {"start", camera_json(state.start, false)},
                  {"cameras", cameras},
                  {"near", state.near_depth},
                  {"has_near", state.has_near},
                  {"has_depth", state.has_depth},
                  {"has_order", state.has_order},
                  {"has_background", state.has_background},
                  {"takes_meshes", state.takes_meshes},
                  {"trains", state.trains}};
  return json_text(json);
}

}  // namespace raysplats::view
