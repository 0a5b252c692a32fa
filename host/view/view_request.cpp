// SPDX-License-Identifier: Apache-2.0
#include "view/view_request.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>

#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "scene/options/trace_option_table.hpp"

namespace raysplats::view {
namespace {

using Json = nlohmann::json;

constexpr double kFarthest = 1e6;
constexpr double kMostTurn = 3600.0;  // degrees
constexpr double kLeastSize = 1e-6;   // of a mesh
constexpr std::size_t kLongestName = 200;
constexpr double kRigid = 1e-2;  // deviation of a pose from a rotation that rounding may cause

[[noreturn]] void refuse(const std::string& what) {
  throw UsageError(fmt::format("The message of the page {}", what));
}

const Json& member(const Json& json, const char* key) {
  const auto found = json.find(key);
  if (found == json.end()) refuse(fmt::format("has no '{}'", key));
  return *found;
}

double number(const Json& value, const char* what, double low, double high) {
  if (!value.is_number()) refuse(fmt::format("has no number as '{}'", what));
  const double x = value.get<double>();
  if (!(x >= low && x <= high)) refuse(fmt::format("has '{}' out of range", what));
  return x;
}

std::string text(const Json& json, const char* key) {
  const Json& value = member(json, key);
  if (!value.is_string()) refuse(fmt::format("has no text as '{}'", key));
  return value.get<std::string>();
}

template <std::size_t N>
std::array<double, N> numbers(const Json& json, const char* key, double low, double high) {
  const Json& list = member(json, key);
  if (!list.is_array() || list.size() != N)
    refuse(fmt::format("has no {} numbers as '{}'", N, key));
  std::array<double, N> out{};
  for (std::size_t i = 0; i < N; ++i) out[i] = number(list[i], key, low, high);
  return out;
}

std::uint32_t id_of(const Json& json) {
  return static_cast<std::uint32_t>(number(member(json, "id"), "id", 0.0, 4294967295.0));
}

/// `c2w` is 3 x 4 by rows, camera axes as Camera has them.
void set_pose(Camera& camera, const std::array<double, 12>& c2w) {
  glm::dmat3 axes;
  glm::dvec3 eye;
  for (glm::length_t row = 0; row < 3; ++row) {
    const double* values = c2w.data() + 4 * row;
    for (glm::length_t column = 0; column < 3; ++column) axes[column][row] = values[column];
    eye[row] = values[3];
  }
  const glm::dmat3 off = glm::transpose(axes) * axes - glm::dmat3(1.0);
  for (int column = 0; column < 3; ++column) {
    if (!(glm::length(off[column]) < kRigid)) refuse("has a 'c2w' that is no rotation");
  }
  if (!(glm::determinant(axes) > 0.0)) refuse("has a 'c2w' that is a reflection");
  camera.rotation = glm::transpose(orthogonal_factor(axes));
  camera.translation = -(camera.rotation * eye);
}

/// `fov` is in degrees along the height: of a fisheye, whose angle grows evenly from the middle, up
/// to all around. A panorama has none: it shows everything.
void set_lens(Camera& camera, const Json& json) {
  camera.cx = 0.5 * camera.width;
  camera.cy = 0.5 * camera.height;
  const std::string model = json.contains("model") ? text(json, "model") : "pinhole";
  constexpr double kRadians = std::numbers::pi / 180.0;
  const auto half_fov = [&](double most) {
    return 0.5 * kRadians * number(member(json, "fov"), "fov", 1.0, most);
  };
  double image = 1.0;  // radius at half the angle of view, in focal lengths
  if (model == "pinhole") {
    image = std::tan(half_fov(170.0));
  } else if (model == "fisheye") {
    camera.model = CameraModel::kFisheye;
    image = half_fov(360.0);
  } else if (model == "equirectangular") {
    camera.model = CameraModel::kEquirectangular;
  } else {
    refuse("asks for an unknown 'model'");
  }
  camera.fy = camera.fx = 0.5 * camera.height / image;
}

ViewRequest view_of(const Json& json, int max_side) {
  ViewRequest request;
  request.id = id_of(json);
  set_pose(request.camera, numbers<12>(json, "c2w", -kFarthest, kFarthest));
  const std::array<double, 2> size = numbers<2>(json, "size", 1.0, 1e5);
  const double cut = std::min(1.0, max_side / std::max(size[0], size[1]));
  Camera& camera = request.camera;
  camera.width = std::max(1, static_cast<int>(std::lround(cut * size[0])));
  camera.height = std::max(1, static_cast<int>(std::lround(cut * size[1])));
  set_lens(camera, json);
  request.moving = io::json_flag(json, "moving");
  request.png = io::json_flag(json, "png");
  if (json.contains("output")) {
    const std::string output = text(json, "output");
    if (output == "depth") {
      request.output = Output::kDepth;
    } else if (output == "normals") {
      request.output = Output::kNormals;
    } else if (output == "hits") {
      request.output = Output::kHits;
    } else if (output == "alpha") {
      request.output = Output::kAlpha;
    } else if (output != "color") {
      refuse("asks for an unknown 'output'");
    }
  }
  if (json.contains("near"))
    request.near_depth = static_cast<float>(number(json["near"], "near", 0.0, kFarthest));
  if (json.contains("order")) {
    request.hit_order = hit_order_of(text(json, "order"));
    if (!request.hit_order) refuse("asks for an unknown 'order'");
  }
  if (json.contains("background")) {
    const std::array<double, 3> color = numbers<3>(json, "background", 0.0, 1.0);
    request.background = {static_cast<float>(color[0]), static_cast<float>(color[1]),
                          static_cast<float>(color[2])};
  }
  return request;
}

glm::dvec3 vector(const Json& json, const char* key, double most) {
  const std::array<double, 3> v = numbers<3>(json, key, -most, most);
  return {v[0], v[1], v[2]};
}

Placement placement_of(const Json& json) {
  Placement out;
  const std::string surface = text(json, "material");
  if (surface == "glass") {
    out.surface = Surface::kGlass;
  } else if (surface == "diffuse") {
    out.surface = Surface::kDiffuse;
  } else if (surface != "mirror") {
    refuse("asks for an unknown 'material'");
  }
  out.at = vector(json, "at", kFarthest);
  out.rotate = vector(json, "rotate", kMostTurn);
  out.size = number(member(json, "size"), "size", kLeastSize, kFarthest);
  return out;
}

MeshOffer offer_of(const Json& json) {
  MeshOffer out;
  const std::string format = text(json, "format");
  if (format == "ply") {
    out.format = io::MeshFormat::kPly;
  } else if (format == "glb") {
    out.format = io::MeshFormat::kGltf;
  } else if (format != "obj") {
    refuse("has a mesh that is neither OBJ nor PLY nor GLB");
  }
  out.name = text(json, "name");
  const bool plain = std::none_of(out.name.begin(), out.name.end(), [](char c) {
    return static_cast<unsigned char>(c) < 0x20 || c == 0x7f || c == '/' || c == '\\';
  });
  if (out.name.empty() || out.name.size() > kLongestName || !plain)
    refuse(fmt::format("has a 'name' that is no file name of up to {} bytes", kLongestName));
  const double bytes = number(member(json, "bytes"), "bytes", 0.0, kFarthest * kFarthest);
  if (bytes < 1.0 || bytes > static_cast<double>(kMostMeshBytes)) {
    throw UsageError(
        fmt::format("A mesh has 1 byte to {} MiB here: put a larger one into a scene file",
                    kMostMeshBytes >> 20));
  }
  out.bytes = static_cast<std::size_t>(bytes);
  out.placement = placement_of(json);
  return out;
}

std::uint32_t mesh_of(const Json& json) {
  return static_cast<std::uint32_t>(number(member(json, "mesh"), "mesh", 0.0, 4294967295.0));
}

}  // namespace

Message parse_message(std::string_view message, int max_side) {
  if (message.size() > kMaxMessage) refuse(fmt::format("has more than {} bytes", kMaxMessage));
  const Json json = Json::parse(message, nullptr, false);
  if (!json.is_object()) refuse("is no JSON object");
  const std::string type = text(json, "type");
  if (type == "view") return view_of(json, max_side);
  if (type == "pick") {
    const std::array<double, 2> place = numbers<2>(json, "px", 0.0, 1.0);
    return PickRequest{id_of(json), view_of(json, max_side), place[0], place[1]};
  }
  using Kind = RunCommand::Kind;
  if (type == "pause") return RunCommand{Kind::kPause};
  if (type == "resume") return RunCommand{Kind::kResume};
  if (type == "save") return RunCommand{Kind::kSave};
  if (type == "share") {
    return RunCommand{Kind::kShare, number(member(json, "share"), "share", 0.0, kMostShare)};
  }
  if (type == "leave") return Leave{};
  if (type == "mesh") return offer_of(json);
  if (type == "place")
    return PlaceMesh{mesh_of(json), placement_of(json), io::json_flag(json, "moving")};
  if (type == "remove") return RemoveMesh{mesh_of(json)};
  if (type == "meshes") return MeshQuestion{};
  if (type == "scene") {
    const Camera camera = view_of(json, max_side).camera;
    if (camera.model != CameraModel::kPinhole)
      throw UsageError("Scenes are saved as a pinhole sees them: choose that camera first");
    return SceneQuestion{camera};
  }
  refuse("has an unknown 'type'");
}

}  // namespace raysplats::view
