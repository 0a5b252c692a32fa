// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/colmap_cameras.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/text_reader.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// Camera models by COLMAP's number; the parameters are those of COLMAP's documentation of camera
/// models.
struct ModelType {
  const char* name;
  std::size_t parameters;
  bool two_focal_lengths;
};
constexpr std::array<ModelType, 18> kModels{{{"SIMPLE_PINHOLE", 3, false},
                                             {"PINHOLE", 4, true},
                                             {"SIMPLE_RADIAL", 4, false},
                                             {"RADIAL", 5, false},
                                             {"OPENCV", 8, true},
                                             {"OPENCV_FISHEYE", 8, true},
                                             {"FULL_OPENCV", 12, true},
                                             {"FOV", 5, true},
                                             {"SIMPLE_RADIAL_FISHEYE", 4, false},
                                             {"RADIAL_FISHEYE", 5, false},
                                             {"THIN_PRISM_FISHEYE", 12, true},
                                             {"RAD_TAN_THIN_PRISM_FISHEYE", 16, true},
                                             {"SIMPLE_DIVISION", 4, false},
                                             {"DIVISION", 5, true},
                                             {"SIMPLE_FISHEYE", 3, false},
                                             {"FISHEYE", 4, true},
                                             {"EUCM", 6, true},
                                             {"EQUIRECTANGULAR", 2, false}}};
constexpr std::size_t kMaxParameters = 16;
constexpr std::uint64_t kMaxCameraSide = 1u << 20;

using Fail = std::function<void(const std::string&)>;

/// The model or an error that names it.
const ModelType& checked_model(const ModelType* model, std::string_view name, const Fail& fail) {
  if (model == nullptr) {
    fail(fmt::format(
        "the camera model {} is not known, undistort the images to PINHOLE first: found", name));
  }
  return *model;
}

/// The lens in COLMAP's order of parameters `p`, which are those behind the principal point;
/// nothing for models that a Distortion says.
std::optional<PhotoLens> photo_lens(std::string_view name, std::span<const double> p) {
  using Form = PhotoLens::Form;
  if (name == "FULL_OPENCV") {
    if (p[5] == 0 && p[6] == 0 && p[7] == 0) return std::nullopt;
    return PhotoLens{Form::kPerspective, {p[0], p[1], p[4]}, {p[5], p[6], p[7]}, p[2], p[3]};
  }
  if (name == "FOV") return PhotoLens{Form::kFov, {p[0]}};
  if (name == "SIMPLE_DIVISION" || name == "DIVISION") return PhotoLens{Form::kDivision, {p[0]}};
  if (name == "EUCM") return PhotoLens{Form::kEucm, {p[0], p[1]}};
  if (name == "THIN_PRISM_FISHEYE") {
    return PhotoLens{Form::kFisheye, {p[0], p[1], p[4], p[5]}, {}, p[2],
                     p[3],           {p[6], 0.0, p[7], 0.0}};
  }
  if (name == "RAD_TAN_THIN_PRISM_FISHEYE") return fisheye624(p.first<12>());
  return std::nullopt;
}

/// The distortion in the same order.
Distortion make_distortion(std::string_view name, std::span<const double> p) {
  Distortion d;
  if (name == "OPENCV" || name == "FULL_OPENCV") {
    d = {p[0], p[1], 0.0, p[2], p[3]};
    if (name == "FULL_OPENCV") d.k3 = p[4];
  } else if (name == "OPENCV_FISHEYE") {
    d.k1 = p[0];
    d.k2 = p[1];
    d.k3 = p[2];
    d.k4 = p[3];
  } else {
    if (!p.empty()) d.k1 = p[0];
    if (p.size() > 1) d.k2 = p[1];
  }
  return d;
}

std::string camera_name(const fs::path& path, std::uint64_t id) {
  return fmt::format("{}: the camera {}", path.string(), id);
}

Camera make_camera(const ModelType& model,
                   const std::string& where,
                   std::uint64_t width,
                   std::uint64_t height,
                   std::span<const double> p,
                   const Fail& fail) {
  Camera camera;
  if (width < 1 || height < 1 || width > kMaxCameraSide || height > kMaxCameraSide) {
    fail(fmt::format("a camera has the impossible size {} x {}", width, height));
  }
  for (const double value : p) {
    if (!std::isfinite(value)) fail("a camera parameter is not finite");
  }
  camera.width = static_cast<int>(width);
  camera.height = static_cast<int>(height);
  const std::string_view name = model.name;
  if (name == "EQUIRECTANGULAR") {
    set_equirectangular(camera);
    return camera;
  }
  const std::size_t center = model.two_focal_lengths ? 2 : 1;
  camera.fx = p[0];
  camera.fy = p[center - 1];
  camera.cx = p[center];
  camera.cy = p[center + 1];
  if (!(camera.fx > 0 && camera.fy > 0)) fail("a camera has a focal length that is not positive");
  if (const std::optional<PhotoLens> lens = photo_lens(name, p.subspan(center + 2))) {
    set_photo_lens(camera, *lens, fmt::format("{} ({})", where, name));
    return camera;
  }
  camera.distortion = make_distortion(name, p.subspan(center + 2));
  if (name.ends_with("FISHEYE")) {
    camera.model = CameraModel::kFisheye;
  } else if (camera.distortion.any()) {
    camera.model = CameraModel::kOpenCv;
  }
  return camera;
}

void add_camera(ColmapModel& model, std::uint64_t id, Camera camera, const Fail& fail) {
  if (!model.cameras.emplace(static_cast<std::uint32_t>(id), std::move(camera)).second) {
    fail(fmt::format("the camera {} appears twice", id));
  }
}

/// The cameras that images name: others may have wrong lenses, or in a text file, where a line ends
/// them, such as are not known.
std::set<std::uint64_t> used_cameras(const ColmapModel& model) {
  std::set<std::uint64_t> used;
  for (const ColmapImage& image : model.images) used.insert(image.camera_id);
  return used;
}

}  // namespace

void read_cameras_binary(const fs::path& path, ColmapModel& model) {
  const std::set<std::uint64_t> used = used_cameras(model);
  const auto bytes = read_file(path);
  ByteReader reader(bytes, path);
  const Fail fail = [&](const std::string& message) { reader.fail(message); };
  const std::uint64_t count = reader.count("number of cameras", 24);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = reader.read<std::uint32_t>("the camera number");
    const auto type = reader.read<std::int32_t>("the camera model");
    const auto width = reader.read<std::uint64_t>("the camera width");
    const auto height = reader.read<std::uint64_t>("the camera height");
    const bool known = type >= 0 && static_cast<std::size_t>(type) < kModels.size();
    const ModelType* candidate = known ? &kModels[static_cast<std::size_t>(type)] : nullptr;
    const ModelType& checked =
        checked_model(candidate, known ? candidate->name : fmt::format("number {}", type), fail);
    std::array<double, kMaxParameters> parameters{};
    for (std::size_t p = 0; p < checked.parameters; ++p) {
      parameters[p] = reader.read<double>("a camera parameter");
    }
    if (!used.contains(id)) continue;
    add_camera(model, id,
               make_camera(checked, camera_name(path, id), width, height,
                           std::span(parameters).first(checked.parameters), fail),
               fail);
  }
}

void read_cameras_text(const fs::path& path, ColmapModel& model) {
  const std::set<std::uint64_t> used = used_cameras(model);
  const auto bytes = read_file(path);
  TextReader reader(bytes, path);
  const Fail fail = [&](const std::string& message) { reader.fail(message); };
  while (reader.next_content_line()) {
    const std::uint64_t id = reader.unsigned_integer("the camera number");
    if (!used.contains(id)) continue;
    const std::string name(reader.word().substr(0, 64));
    const auto found = std::find_if(kModels.begin(), kModels.end(),
                                    [&](const ModelType& type) { return type.name == name; });
    const ModelType& checked =
        checked_model(found == kModels.end() ? nullptr : &*found, "'" + name + "'", fail);
    const std::uint64_t width = reader.unsigned_integer("the camera width");
    const std::uint64_t height = reader.unsigned_integer("the camera height");
    std::array<double, kMaxParameters> parameters{};
    for (std::size_t p = 0; p < checked.parameters; ++p)
      parameters[p] = reader.number("a camera parameter");
    if (const std::string_view more = reader.word(); !more.empty()) {
      reader.fail(fmt::format("{} has {} parameters and '{}' follows them", checked.name,
                              checked.parameters, excerpt(more)));
    }
    add_camera(model, id,
               make_camera(checked, camera_name(path, id), width, height,
                           std::span(parameters).first(checked.parameters), fail),
               fail);
  }
}

}  // namespace raysplats::io
