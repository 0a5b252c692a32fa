// SPDX-License-Identifier: Apache-2.0
#include "io/scene/camera_path_file.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "io/json_file.hpp"
#include "io/scene/scene_camera.hpp"
#include "io/toml_table.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/camera_path.hpp"
#include "scene/gaussians/gaussian_transform.hpp"

namespace raysplats {
namespace {

using Json = nlohmann::json;
using Matrix = std::array<double, 16>;  // by rows

constexpr double kFps = 30.0;
constexpr double kMostFps = 1000.0;
constexpr double kMostSeconds = 86400.0;
constexpr double kMostFrames = 1e6;
constexpr double kRigid = 1e-2;  // deviation from a rotation that rounding may cause

double element(const Matrix& matrix, int row, int column) {
  return matrix[4 * static_cast<std::size_t>(row) + static_cast<std::size_t>(column)];
}

/// A path as a file has it, before anybody asks for other moments.
struct Stored {
  CameraPath path;
  bool frames = false;  // the keyframes are the frames themselves
  CameraModel model = CameraModel::kPinhole;
  int width = 1920;
  int height = 1080;
  double fps = kFps;
  std::optional<double> seconds;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
  throw DataError(fmt::format("The camera path {} {}", path.string(), what));
}

double number(const std::filesystem::path& path,
              const Json& json,
              const char* key,
              double low,
              double high,
              std::optional<double> otherwise) {
  const auto found = json.find(key);
  if (found == json.end() || found->is_null()) {
    if (otherwise) return *otherwise;
    fail(path, fmt::format("has no number '{}'", key));
  }
  // Forms of web pages leave texts.
  double value = NAN;
  if (found->is_number()) value = found->get<double>();
  if (found->is_string()) {
    const auto& text = found->get_ref<const std::string&>();
    const auto end = text.data() + text.size();
    if (std::from_chars(text.data(), end, value).ptr != end) value = NAN;
  }
  if (!(value >= low && value <= high))
    fail(path, fmt::format("has '{}' where a number from {} to {} belongs", key, low, high));
  return value;
}

/// Numbers of a text, whatever else is between them.
std::vector<double> numbers_in(const std::string& text) {
  std::vector<double> out;
  const char* const end = text.data() + text.size();
  for (const char* at = text.data(); at < end && out.size() <= 16;) {
    double value = 0;
    const auto [after, error] = std::from_chars(at, end, value);
    if (error == std::errc()) {
      out.push_back(value);
      at = after;
    } else {
      ++at;
    }
  }
  return out;
}

/// 16 numbers, flat or as rows; as text, by columns as nerfstudio's add-ons store them.
Matrix matrix_of(const std::filesystem::path& path, const Json& json, const char* key) {
  const auto found = json.find(key);
  std::vector<double> values;
  bool by_columns = false;
  if (found != json.end() && found->is_string()) {
    values = numbers_in(found->get_ref<const std::string&>());
    by_columns = true;
  } else if (found != json.end() && found->is_array()) {
    for (const Json& item : *found) {
      const Json row = item.is_array() ? item : Json::array({item});
      for (const Json& value : row) {
        if (value.is_number() && values.size() < 17) values.push_back(value.get<double>());
      }
    }
  }
  if (values.size() == 12) values.insert(values.end(), {0.0, 0.0, 0.0, 1.0});
  if (values.size() != 16) fail(path, fmt::format("has no 4 x 4 numbers as '{}'", key));
  Matrix matrix{};
  for (std::size_t i = 0; i < 16; ++i)
    matrix[i] = by_columns ? values[4 * (i % 4) + i / 4] : values[i];
  return matrix;
}

/// nerfstudio's seconds are those of the way to a keyframe, from the last to the first where the
/// path is closed.
void count_from_start(std::vector<Keyframe>& keys) {
  const double first = keys.front().seconds;
  for (std::size_t i = 0; i + 1 < keys.size(); ++i) keys[i].seconds = keys[i + 1].seconds;
  keys.back().seconds = first;
}

/// A pose of OpenGL axes (right, up, back).
void set_pose(const std::filesystem::path& path, const Matrix& matrix, Keyframe& key) {
  const auto ends_well = [](const std::array<double, 4>& last) {
    return std::hypot(last[0], last[1], last[2]) < kRigid && std::abs(last[3] - 1.0) < kRigid;
  };
  if (!ends_well({matrix[12], matrix[13], matrix[14], matrix[15]})) {
    fail(path, ends_well({matrix[3], matrix[7], matrix[11], matrix[15]})
                   ? "has a matrix that seems transposed: its last column is 0 0 0 1, which has to "
                     "be its last row (numbers go by rows, those in a text by columns)"
                   : "has a matrix with another last row than 0 0 0 1");
  }
  glm::dmat3 axes;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      const double value = element(matrix, row, column);
      axes[column][row] = column == 0 ? value : -value;
    }
    key.eye[row] = element(matrix, row, 3);
  }
  const glm::dmat3 off = glm::transpose(axes) * axes - glm::dmat3(1.0);
  for (int i = 0; i < 3; ++i) {
    if (!(glm::length(off[i]) < kRigid) || !std::isfinite(key.eye[i]))
      fail(path, "has a matrix that is no rigid motion");
  }
  if (!(glm::determinant(axes) > 0.0)) fail(path, "has a matrix that is a reflection");
  key.axes = orthogonal_factor(axes);
}

CameraModel model_of(const std::filesystem::path& path, const Json& json) {
  const auto found = json.find("camera_type");
  if (found == json.end()) return CameraModel::kPinhole;
  const std::string type = found->is_string() ? found->get<std::string>() : "";
  if (type == "perspective") return CameraModel::kPinhole;
  if (type == "fisheye") return CameraModel::kFisheye;
  if (type == "equirectangular") return CameraModel::kEquirectangular;
  throw UsageError(
      fmt::format("The camera path {} is for a camera of type '{}': perspective, fisheye and "
                  "equirectangular can be drawn",
                  path.string(), type));
}

/// That of a keyframe or frame, or of those that name none, of a fisheye as with_lens() takes it;
/// no panorama has any.
double fov_of(const std::filesystem::path& path,
              const Json& entry,
              const char* key,
              CameraModel model,
              double otherwise) {
  const double fov = number(path, entry, key, kLeastFov, 360.0, otherwise);
  const double most = most_fov(CameraModel::kPinhole);
  if (model == CameraModel::kEquirectangular || fov <= most) return fov;
  fail(path,
       fmt::format("has the '{}' {:g} where at most {:g} degrees belong{}", key, fov, most,
                   model == CameraModel::kFisheye ? ": that of a fisheye is, as in nerfstudio, "
                                                    "that of the pinhole with its focal length"
                                                  : ""));
}

Stored read_json(const std::filesystem::path& path) {
  const Json json = io::read_json_object(path);
  Stored out;
  out.model = model_of(path, json);
  const auto side = [&](const char* key, int otherwise) {
    return static_cast<int>(number(path, json, key, 1, kMaxSide, otherwise));
  };
  out.width = side("render_width", out.width);
  out.height = side("render_height", out.height);
  out.fps = number(path, json, "fps", 1e-3, kMostFps, kFps);
  if (json.contains("seconds"))
    out.seconds = number(path, json, "seconds", 1e-3, kMostSeconds, std::nullopt);
  out.path.closed = io::json_flag(json, "is_cycle");
  const auto list = [&](const char* key) -> const Json* {
    const auto found = json.find(key);
    return found != json.end() && found->is_array() && !found->empty() ? &*found : nullptr;
  };
  const Json* frames = list("camera_path");
  const Json* keys = list("keyframes");
  if (!frames && !keys) fail(path, "has neither 'camera_path' nor 'keyframes' with entries");
  out.frames = frames != nullptr;
  const double fov = fov_of(path, json, "default_fov", out.model, 50.0);
  const double transition = number(path, json, "default_transition_sec", 0, kMostSeconds, 1.0);
  for (const Json& entry : frames ? *frames : *keys) {
    if (!entry.is_object()) fail(path, "has an entry that is no object");
    Keyframe key;
    set_pose(path, matrix_of(path, entry, frames ? "camera_to_world" : "matrix"), key);
    key.fov = fov_of(path, entry, "fov", out.model, fov);
    key.seconds = io::json_flag(entry, "override_transition_enabled")
                      ? number(path, entry, "override_transition_sec", 0, kMostSeconds, transition)
                      : (frames ? 1.0 : transition);
    out.path.keys.push_back(key);
  }
  count_from_start(out.path.keys);
  if (const auto crop = json.find("crop"); crop != json.end() && !crop->is_null()) {
    spdlog::warn(
        "The camera path {} crops the scene, which is drawn whole: 'raysplats convert MODEL OUT "
        "--crop' makes a model of a part",
        path.string());
  }
  return out;
}

Stored read_toml(const std::filesystem::path& path) {
  const toml::table root = io::read_toml(path);
  io::TomlTable table(root, path, "the camera path");
  Stored out;
  table.number("width", out.width, 1, kMaxSide);
  table.number("height", out.height, 1, kMaxSide);
  table.number("fps", out.fps, 1e-3, kMostFps);
  out.seconds = table.number("seconds", 1e-3, kMostSeconds);
  table.flag("closed", out.path.closed);
  table.choice("speed", out.path.constant_speed, {{"constant", true}, {"by-seconds", false}});
  for (io::TomlTable& entry : table.list("key")) {
    const auto vector = [&](const char* name) {
      const auto value = entry.vector(name);
      if (!value)
        entry.fail(name, fmt::format("'{0}' in [[key]] is missing: {0} = [x, y, z]", name));
      return *value;
    };
    Keyframe key;
    const glm::dvec3 eye = vector("eye");
    const glm::dvec3 target = vector("target");
    const glm::dvec3 up = entry.direction("up").value_or(glm::dvec3(0, -1, 0));
    if (eye == target) entry.fail("target", "'eye' and 'target' in [[key]] are the same point");
    if (!(glm::length(glm::cross(glm::normalize(up), glm::normalize(target - eye))) > 1e-9)) {
      entry.fail(
          "up", "'up' in [[key]] is along the view: 'eye', 'target' and 'up' have to span a plane");
    }
    entry.number("fov", key.fov, kLeastFov, most_fov(CameraModel::kPinhole));
    entry.number("seconds", key.seconds, 0, kMostSeconds);
    entry.finish();
    key.eye = eye;
    key.axes = glm::transpose(look_at(eye, target, up, 1, 1, 1.0).rotation);
    out.path.keys.push_back(key);
  }
  table.finish();
  if (out.path.keys.empty())
    throw UsageError(
        fmt::format("{} has no [[key]]: give eye and target of some views", path.string()));
  return out;
}

/// x -> scale * (turn x + shift).
struct Similarity {
  double scale = 1.0;
  glm::dmat3 turn{1.0};
  glm::dvec3 shift{0.0};
};

Similarity similarity_of(const std::filesystem::path& file,
                         const Json& json,
                         const char* matrix_key,
                         double scale) {
  const Matrix matrix = matrix_of(file, json, matrix_key);
  Similarity out{scale, {}, {}};
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) out.turn[column][row] = element(matrix, row, column);
    out.shift[row] = element(matrix, row, 3);
  }
  out.turn = orthogonal_factor(out.turn);
  return out;
}

/// What nerfstudio's dataparser did: from the coordinates before the applied_transform of the data
/// set, which its file counts in, or with the data set's file from those of that.
Similarity dataparser_map(const PathOptions& options) {
  const std::filesystem::path& file = options.transform;
  const Json json = io::read_json_object(file);
  Similarity out = similarity_of(file, json, "transform",
                                 number(file, json, "scale", 1e-12, 1e12, std::nullopt));
  if (options.data_transform.empty()) return out;
  const std::filesystem::path& data = options.data_transform;
  const Json set = io::read_json_object(data);
  out.scale /= number(data, set, "applied_scale", 1e-12, 1e12, 1.0);
  if (!set.contains("applied_transform")) return out;
  const Similarity applied = similarity_of(data, set, "applied_transform", 1.0);
  out.turn = out.turn * glm::transpose(applied.turn);
  out.shift -= out.turn * applied.shift;
  return out;
}

/// Takes the path from nerfstudio's world back to that of the data.
void undo_transform(const PathOptions& options, CameraPath& path) {
  const Similarity map = dataparser_map(options);
  const glm::dmat3 back = glm::transpose(map.turn);
  for (Keyframe& key : path.keys) {
    key.eye = back * (key.eye / map.scale - map.shift);
    key.axes = back * key.axes;
  }
}

double total_seconds(const CameraPath& path) {
  double sum = 0;
  for (const Keyframe& key : path.keys) sum += key.seconds;
  return path.closed ? sum : sum - path.keys.back().seconds;
}

/// As nerfstudio's cameras: a fisheye has the focal length of the pinhole with that angle, and an
/// equirectangular picture shows everything around.
Camera with_lens(Camera camera, CameraModel model) {
  camera.model = model;
  if (model == CameraModel::kEquirectangular) {
    camera.fx = 0.5 * camera.width;
    camera.fy = camera.height;
  }
  return camera;
}

}  // namespace

CameraPathFile read_camera_path(const std::filesystem::path& path, const PathOptions& options) {
  Stored stored = path.extension() == ".toml" ? read_toml(path) : read_json(path);
  if (!options.transform.empty()) undo_transform(options, stored.path);
  stored.path.constant_speed = stored.path.constant_speed || options.constant_speed;
  CameraPathFile out;
  out.fps = options.fps.value_or(stored.fps);
  out.closed = stored.path.closed;
  const bool as_they_are =
      stored.frames && !options.seconds && out.fps == stored.fps && !options.constant_speed;
  std::vector<Keyframe> views = stored.path.keys;
  if (!as_they_are) {
    const double own = stored.frames ? static_cast<double>(views.size()) / stored.fps
                                     : stored.seconds.value_or(total_seconds(stored.path));
    const double seconds = options.seconds.value_or(own);
    const double count = std::round(seconds * out.fps);
    if (!(count <= kMostFrames)) {
      throw UsageError(
          fmt::format("{} seconds at {} frames a second are more than {} frames: ask for fewer",
                      seconds, out.fps, kMostFrames));
    }
    views = path_views(stored.path, std::max(1, static_cast<int>(count)));
  }
  out.cameras.reserve(views.size());
  for (const Keyframe& view : views) {
    const Camera camera = camera_of(view, stored.width, stored.height);
    out.cameras.push_back(with_lens(resized(camera, options.width, options.height), stored.model));
    out.cameras.back().name = fmt::format("frame_{:04d}", out.cameras.size() - 1);
    require_believable(out.cameras.back(),
                       fmt::format("{}: frame {}", path.string(), out.cameras.size() - 1));
  }
  return out;
}

}  // namespace raysplats
