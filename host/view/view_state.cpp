// SPDX-License-Identifier: Apache-2.0
#include "view/view_state.hpp"

#include <algorithm>
#include <cmath>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <numbers>

namespace raysplats::view {
namespace {

using Json = nlohmann::json;

constexpr double kLeastFov = 10.0;
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

/// Of the picture's height. Lenses without a focal length that says it get the page's largest.
double vertical_fov(const Camera& camera) {
  const bool angle = camera.model == CameraModel::kPinhole ||
                     camera.model == CameraModel::kOpenCv || camera.model == CameraModel::kFisheye;
  if (!angle || !(camera.fy > 0.0)) return kMostFov;
  const double degrees =
      2.0 * std::atan(0.5 * camera.height / camera.fy) * 180.0 / std::numbers::pi;
  return std::clamp(degrees, kLeastFov, kMostFov);
}

Json camera_json(const Camera& camera) {
  return {{"name", camera.name},
          {"c2w", pose_json(camera)},
          {"fov", vertical_fov(camera)},
          {"aspect", static_cast<double>(camera.width) / std::max(camera.height, 1)}};
}

}  // namespace

std::string state_json(const ViewState& state) {
  Json cameras = Json::array();
  for (const Camera& camera : state.cameras) cameras.push_back(camera_json(camera));
  const Json json{{"version", RAYSPLATS_VERSION},
                  {"name", state.name},
                  {"about", state.about},
                  {"center", vector_json(state.extent.center)},
                  {"radius", state.extent.radius},
                  {"up", vector_json(state.up)},
                  {"start", camera_json(state.start)},
                  {"cameras", cameras},
                  {"near", state.near_depth},
                  {"has_near", state.has_near},
                  {"has_depth", state.has_depth}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace raysplats::view
