// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/transforms_camera.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <span>

#include "io/dataset/camera_model_names.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats::io {
namespace {

using nlohmann::json;

/// Focal lengths across and down, as far as the frame has them, in pixels of its own size. Angles
/// are those of planes alone, which show no half of the world.
std::array<std::optional<double>, 2> focal_lengths(const TransformsFile& file,
                                                   const TransformsFrame& frame,
                                                   double width,
                                                   double height) {
  if (frame.fx || frame.fy || frame.model != CameraModel::kPinhole) return {frame.fx, frame.fy};
  const auto focal = [&](double side, const std::optional<double>& angle) -> std::optional<double> {
    if (!angle) return std::nullopt;
    if (*angle < std::numbers::pi) return 0.5 * side / std::tan(0.5 * *angle);
    throw DataError(fmt::format(
        "{}: frame {} has an angle of view of {:.6g} degrees, but no plane shows 180 degrees or "
        "more: give the camera_model and fl_x of its lens, in it or in the file",
        file.path.string(), frame.number, *angle * 180.0 / std::numbers::pi));
  };
  return {focal(width, frame.angle_x), focal(height, frame.angle_y)};
}

/// The lens of a frame that a Distortion does not say; `reach` is the image radius of the farthest
/// corner, `crop` that of crop_radius or 0.
std::optional<PhotoLens> photo_lens(const TransformsFrame& frame, double reach, double crop) {
  const Distortion& d = frame.distortion;
  const bool cropped = crop > 0 && crop < reach;
  std::optional<PhotoLens> lens;
  if (frame.model == CameraModel::kPhotoLens) {
    lens = fisheye624(std::span<const double, 12>(frame.fisheye624));
  } else if (frame.model == CameraModel::kFisheye && (d.p1 != 0 || d.p2 != 0 || cropped)) {
    lens = PhotoLens{PhotoLens::Form::kFisheye, {d.k1, d.k2, d.k3, d.k4}, {}, d.p1, d.p2};
  } else if (frame.model == CameraModel::kPinhole && d.k4 != 0) {
    lens = PhotoLens{PhotoLens::Form::kPerspective, {d.k1, d.k2, d.k3, d.k4}, {}, d.p1, d.p2};
  }
  if (lens && cropped && frame.model != CameraModel::kPinhole) lens->radius = crop;
  return lens;
}

}  // namespace

Camera frame_camera(const TransformsFile& file, std::size_t index, int width, int height) {
  const TransformsFrame& frame = file.frames[index];
  const double nominal_width = frame.width.value_or(width);
  const double nominal_height = frame.height.value_or(height);
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.rotation = frame.rotation;
  camera.translation = frame.translation;
  camera.model = frame.model;
  if (frame.model == CameraModel::kEquirectangular) {
    set_equirectangular(camera);
    return camera;
  }
  const auto [fx, fy] = focal_lengths(file, frame, nominal_width, nominal_height);
  if (!fx && !fy) {
    throw DataError(fmt::format(
        "{}: frame {} has {}, in it or in the file", file.path.string(), frame.number,
        frame.model == CameraModel::kPinhole ? "neither fl_x nor camera_angle_x (nor x_fov)"
                                             : "no fl_x, which its camera model needs"));
  }
  // Pixels are square where one of the two is all that is said.
  camera.fx = fx ? *fx : *fy;
  camera.fy = fy ? *fy : *fx;
  const double scale_x = width / nominal_width;
  const double scale_y = height / nominal_height;
  camera.cx = frame.cx.value_or(0.5 * nominal_width) * scale_x;
  camera.cy = frame.cy.value_or(0.5 * nominal_height) * scale_y;
  camera.fx *= scale_x;
  camera.fy *= scale_y;
  if (frame.model == CameraModel::kOrthographic) return camera;
  const double crop = frame.crop_radius.value_or(0.0) * scale_x / camera.fx;
  if (const std::optional<PhotoLens> lens = photo_lens(frame, image_reach(camera), crop)) {
    set_photo_lens(camera, *lens,
                   fmt::format("{}: the camera of frame {}", file.path.string(), frame.number));
    return camera;
  }
  camera.distortion = frame.distortion;
  if (frame.model == CameraModel::kPinhole && frame.distortion.any())
    camera.model = CameraModel::kOpenCv;
  return camera;
}

json lens_keys(const Camera& camera) {
  json out{{"camera_model", model_name(camera.model)}, {"cx", camera.cx}, {"cy", camera.cy}};
  const Distortion& d = camera.distortion;
  const bool fisheye = camera.model == CameraModel::kFisheye;
  if (fisheye || camera.model == CameraModel::kOpenCv) {
    out.update({{"k1", d.k1}, {"k2", d.k2}, {"k3", d.k3}});
    out.update(fisheye ? json{{"k4", d.k4}} : json{{"p1", d.p1}, {"p2", d.p2}});
  }
  return out;
}

}  // namespace raysplats::io
