// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/transforms.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <string>

#include "io/dataset/camera_model_names.hpp"
#include "io/json_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr double kLeastAxis = 1e-6;
constexpr double kDegree = std::numbers::pi / 180.0;

/// A number, also one that was written as a text ("500").
std::optional<double> number_of(const json& value) {
  if (value.is_number()) return value.get<double>();
  double out = 0;
  if (value.is_string() && parse_number(value.get_ref<const std::string&>(), out)) return out;
  return std::nullopt;
}

/// One scope of keys: the file or a frame of it, with its name for errors.
struct Scope {
  const json& object;
  const fs::path& path;
  std::string where;

  [[noreturn]] void fail(const std::string& message) const {
    throw DataError(fmt::format("{}, {}: {}", path.string(), where, message));
  }
  std::optional<double> number(const char* key) const {
    const auto found = object.find(key);
    if (found == object.end() || found->is_null()) return std::nullopt;
    const std::optional<double> value = number_of(*found);
    if (!value) fail(fmt::format("'{}' is not a number, it is a {}", key, found->type_name()));
    if (!std::isfinite(*value)) fail(fmt::format("'{}' is not finite", key));
    return value;
  }
  std::string text(const char* key) const {
    const auto found = object.find(key);
    if (found == object.end() || found->is_null()) return {};
    if (!found->is_string())
      fail(fmt::format("'{}' is not a text, it is a {}", key, found->type_name()));
    return found->get<std::string>();
  }
  std::optional<double> positive(const char* key) const {
    const auto value = number(key);
    if (value && !(*value > 0)) fail(fmt::format("'{}' is {}, which is not positive", key, *value));
    return value;
  }
  std::optional<int> side(const char* key) const {
    const auto value = number(key);
    if (!value) return std::nullopt;
    if (!(*value >= 1 && *value <= kMaxSide) || *value != std::floor(*value)) {
      fail(fmt::format("'{}' is {}, which is no image size", key, *value));
    }
    return static_cast<int>(*value);
  }
  /// Of radians, else of degrees.
  std::optional<double> angle(const char* radians, const char* degrees) const {
    if (const auto value = positive(radians)) return value;
    const auto value = positive(degrees);
    return value ? std::optional(*value * kDegree) : std::nullopt;
  }
  /// Whether it is true, or 1 as some programs write it.
  bool flag(const char* key) const {
    const auto found = object.find(key);
    if (found == object.end() || found->is_null()) return false;
    if (found->is_boolean()) return found->get<bool>();
    const std::optional<double> value = number_of(*found);
    if (!value || (*value != 0 && *value != 1))
      fail(fmt::format("'{}' is neither true nor false", key));
    return *value == 1;
  }
};

void read_model(const Scope& scope, TransformsFrame& frame) {
  const std::string name = scope.text("camera_model");
  if (!name.empty()) {
    const std::optional<CameraModel> model = model_of_name(name);
    if (!model) {
      scope.fail(
          fmt::format("the camera_model '{}' is not supported ({} are), undistort the images first",
                      name, model_names()));
    }
    frame.model = *model;
  }
  if (scope.flag("is_fisheye")) frame.model = CameraModel::kFisheye;
}

/// nerfstudio's list of parameters: k1 to k4, p1 and p2, or the twelve of FISHEYE624.
void read_parameters(const Scope& scope, TransformsFrame& frame) {
  const auto found = scope.object.find("distortion_params");
  if (found == scope.object.end() || found->is_null()) return;
  std::vector<double> values;
  for (const json& value : *found) {
    const std::optional<double> parameter = number_of(value);
    if (!parameter || !std::isfinite(*parameter))
      scope.fail("'distortion_params' holds something that is no finite number");
    values.push_back(*parameter);
  }
  if (values.size() == 12) {
    frame.fisheye624 = std::move(values);
  } else if (values.size() == 6) {
    frame.distortion = {values[0], values[1], values[2], values[4], values[5], values[3]};
  } else {
    scope.fail(
        fmt::format("'distortion_params' has {} numbers, not 6 or 12 (FISHEYE624)", values.size()));
  }
}

/// Overrides what is known by the keys of a scope.
void read_intrinsics(const Scope& scope, TransformsFrame& frame) {
  read_model(scope, frame);
  if (const auto width = scope.side("w")) frame.width = width;
  if (const auto height = scope.side("h")) frame.height = height;
  const auto fx = scope.positive("fl_x");
  const auto fy = scope.positive("fl_y");
  const auto angle_x = scope.angle("camera_angle_x", "x_fov");
  const auto angle_y = scope.angle("camera_angle_y", "y_fov");
  if (fx || fy || angle_x || angle_y) {
    // A focal length of a frame must not be mixed with an angle of the file.
    frame.fx = fx;
    frame.fy = fy;
    frame.angle_x = angle_x;
    frame.angle_y = angle_y;
  }
  if (const auto cx = scope.number("cx")) frame.cx = cx;
  if (const auto cy = scope.number("cy")) frame.cy = cy;
  Distortion& d = frame.distortion;
  d.k1 = scope.number("k1").value_or(d.k1);
  d.k2 = scope.number("k2").value_or(d.k2);
  d.k3 = scope.number("k3").value_or(d.k3);
  d.k4 = scope.number("k4").value_or(d.k4);
  d.p1 = scope.number("p1").value_or(d.p1);
  d.p2 = scope.number("p2").value_or(d.p2);
  for (const char* term : {"k5", "k6"}) {
    if (scope.number(term).value_or(0.0) == 0.0) continue;
    scope.fail(fmt::format(
        "'{}' is a term of a lens that is not supported, undistort the images first", term));
  }
  read_parameters(scope, frame);
  if (const auto radius = scope.positive("fisheye_crop_radius")) frame.crop_radius = radius;
}

/// Those of one camera, over what the file says of all.
void read_own_intrinsics(const Scope& scope, TransformsFrame& frame) {
  read_intrinsics(scope, frame);
  if (frame.model == CameraModel::kPhotoLens && frame.fisheye624.empty())
    scope.fail("FISHEYE624 needs the twelve numbers of 'distortion_params'");
}

/// The signs that make the columns of the file's matrices right, down and forward. As a rule these
/// are right, up and backward, as OpenGL has them.
glm::dvec3 axis_signs(const Scope& scope) {
  if (scope.flag("from_na")) {
    spdlog::info("{} has from_na, as NeuS2 writes it: its cameras have y down and z forward",
                 scope.path.string());
    return {1, 1, 1};
  }
  if (scope.object.contains("normal_mts_args")) {
    spdlog::info(
        "{} has normal_mts_args, as instant-ngp reads it: its cameras are Mitsuba's, with x to the "
        "left and z forward",
        scope.path.string());
    return {-1, -1, 1};
  }
  return {1, -1, -1};
}

/// Rows of four numbers: three or four of them, each a list or all in one.
std::vector<std::array<double, 4>> matrix_rows(const Scope& scope) {
  constexpr std::size_t kColumns = 4;
  const auto found = scope.object.find("transform_matrix");
  if (found == scope.object.end()) scope.fail("the transform_matrix is missing");
  const bool flat = found->is_array() && !found->empty() && !found->front().is_array();
  const std::size_t count = found->is_array() ? found->size() / (flat ? kColumns : 1) : 0;
  if (count < 3 || count > 4 || (flat && found->size() % kColumns != 0)) {
    scope.fail("the transform_matrix has not 4 rows of 4 numbers");
  }
  std::vector<std::array<double, 4>> rows(count);
  for (std::size_t row = 0; row < count; ++row) {
    const json& line = flat ? *found : (*found)[row];
    if (!flat && (!line.is_array() || line.size() != kColumns))
      scope.fail("a row of the transform_matrix has not 4 numbers");
    for (std::size_t column = 0; column < kColumns; ++column) {
      const auto value = number_of(line[flat ? kColumns * row + column : column]);
      if (!value) scope.fail("the transform_matrix holds something that is no number");
      if (!std::isfinite(*value)) scope.fail("the transform_matrix is not finite");
      rows[row][column] = *value;
    }
  }
  return rows;
}

void check_last_row(const Scope& scope, const std::vector<std::array<double, 4>>& rows) {
  if (rows.size() < 4) return;
  const auto is_last = [](const std::array<double, 4>& numbers) {
    constexpr std::array<double, 4> kLast{0, 0, 0, 1};
    return std::equal(numbers.begin(), numbers.end(), kLast.begin(),
                      [](double a, double b) { return std::abs(a - b) <= 1e-6; });
  };
  if (is_last(rows[3])) return;
  const bool turned = is_last({rows[0][3], rows[1][3], rows[2][3], rows[3][3]});
  scope.fail(fmt::format("the last row of the transform_matrix is not 0 0 0 1{}",
                         turned ? ", but its last column is: transpose the matrices" : ""));
}

/// Deviation from a rotation of one whose numbers have two decimals.
constexpr double kRoundedTolerance = 2e-2;

/// Reads the pose; whether its axes had another length than 1, which does not change what a camera
/// sees: exporters of Blender write cameras that were scaled as objects.
bool read_pose(const Scope& scope, const glm::dvec3& signs, TransformsFrame& frame) {
  const std::vector<std::array<double, 4>> rows = matrix_rows(scope);
  check_last_row(scope, rows);
  glm::dmat3 rotation;
  glm::dvec3 position;
  for (int i = 0; i < 3; ++i) {
    const std::array<double, 4>& row = rows[static_cast<std::size_t>(i)];
    for (int j = 0; j < 3; ++j) rotation[j][i] = row[static_cast<std::size_t>(j)];
    position[i] = row[3];
  }
  bool scaled = false;
  for (int i = 0; i < 3; ++i) {
    const double length = glm::length(rotation[i]);
    if (!(length > kLeastAxis && length < 1.0 / kLeastAxis)) continue;
    if (std::abs(length * length - 1.0) <= kRotationTolerance) continue;
    rotation[i] /= length;
    scaled = true;
  }
  if (!is_rotation(rotation, kRoundedTolerance)) {
    scope.fail(
        "the transform_matrix is no rotation with a translation (it shears, mirrors or is "
        "singular)");
  }
  // Newton's iteration for the nearest rotation (Higham 1986); three steps end at rounding from
  // 2e-2.
  for (int step = 0; step < 3; ++step) {
    rotation = 0.5 * (rotation + glm::transpose(glm::inverse(rotation)));
  }
  for (int i = 0; i < 3; ++i) rotation[i] *= signs[i];
  frame.rotation = glm::transpose(rotation);
  frame.translation = -(frame.rotation * position);
  return scaled;
}

std::optional<std::vector<std::string>> read_names(const Scope& scope, const char* key) {
  const auto found = scope.object.find(key);
  if (found == scope.object.end() || found->is_null()) return std::nullopt;
  if (!found->is_array()) scope.fail(fmt::format("'{}' is no list", key));
  std::vector<std::string> names;
  for (const json& name : *found) {
    if (!name.is_string()) scope.fail(fmt::format("'{}' holds something that is no text", key));
    names.push_back(portable_path(name.get<std::string>()));
  }
  return names;
}

/// Appends lists of frames to those of a file, but those that ScanNet++ marks as bad.
struct FrameReader {
  const TransformsFrame& common;
  const glm::dvec3 signs;
  TransformsFile& file;
  std::size_t scaled = 0;
  std::size_t bad = 0;

  /// `what`: "frame", as errors name one with its place in the list. Returns the paths of the
  /// photos.
  std::vector<std::string> read(const json& list, const char* what) {
    std::vector<std::string> names;
    std::size_t place = 0;
    for (const json& object : list) {
      const Scope scope{object, file.path, fmt::format("{} {}", what, place++)};
      if (!object.is_object()) scope.fail("it is no JSON object");
      if (scope.flag("is_bad")) {
        ++bad;
        continue;
      }
      TransformsFrame frame = common;
      frame.number = file.frames.size();
      read_own_intrinsics(scope, frame);
      scaled += read_pose(scope, signs, frame) ? 1 : 0;
      frame.file_path = portable_path(scope.text("file_path"));
      frame.mask_path = portable_path(scope.text("mask_path"));
      frame.depth_path = portable_path(scope.text("depth_file_path"));
      names.push_back(frame.file_path);
      file.frames.push_back(std::move(frame));
    }
    return names;
  }
};

/// ScanNet++ has frames to test in a list of their own, which counts where no names of frames do.
void read_test_frames(const Scope& scope, FrameReader& reader) {
  const auto found = scope.object.find("test_frames");
  if (found == scope.object.end() || found->is_null()) return;
  if (!found->is_array()) scope.fail("'test_frames' is no list");
  TransformsFile& file = reader.file;
  std::vector<std::string> train;
  for (const TransformsFrame& frame : file.frames) train.push_back(frame.file_path);
  std::vector<std::string> test = reader.read(*found, "test frame");
  if (test.empty() || file.train_filenames || file.val_filenames || file.test_filenames) return;
  file.train_filenames = std::move(train);
  file.test_filenames = std::move(test);
}

}  // namespace

TransformsFrame stated_intrinsics(const json& object,
                                  const fs::path& path,
                                  const std::string& where) {
  TransformsFrame frame;
  read_own_intrinsics({object, path, where}, frame);
  return frame;
}

TransformsFile read_transforms(const fs::path& path) {
  return parse_transforms(read_json_object(path), path);
}

TransformsFile parse_transforms(const json& root, const fs::path& path) {
  const Scope scope{root, path, "the file"};
  TransformsFile file;
  file.path = path;
  file.ply_file_path = portable_path(scope.text("ply_file_path"));
  file.train_filenames = read_names(scope, "train_filenames");
  file.val_filenames = read_names(scope, "val_filenames");
  file.test_filenames = read_names(scope, "test_filenames");
  TransformsFrame common;
  read_intrinsics(scope, common);
  const auto frames = root.find("frames");
  if (frames == root.end() || !frames->is_array()) {
    throw DataError(fmt::format("{} has no list of frames: it is no camera file", path.string()));
  }
  FrameReader reader{common, axis_signs(scope), file};
  reader.read(*frames, "frame");
  read_test_frames(scope, reader);
  if (reader.bad > 0 && file.frames.empty())
    scope.fail("every frame is marked as 'is_bad': remove the marks of those to use");
  if (reader.bad > 0) {
    spdlog::info("{} of {} frames of {} are marked as 'is_bad' and left out", reader.bad,
                 reader.bad + file.frames.size(), path.string());
  }
  if (reader.scaled > 0) {
    spdlog::info("{} of {} cameras of {} are scaled, which does not change what they see",
                 reader.scaled, file.frames.size(), path.string());
  }
  return file;
}

std::string inner_name(const fs::path& path) {
  fs::path name;
  for (const fs::path& part : path.lexically_normal().relative_path()) {
    if (part != ".." && part != ".") name /= part;
  }
  return name.generic_string();
}

}  // namespace raysplats::io
