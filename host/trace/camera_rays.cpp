// SPDX-License-Identifier: Apache-2.0
#include "trace/camera_rays.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/pixel_spacing.hpp"
#include "scene/image/pixel_count.hpp"
#include "shared/layout.h"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

BuildOptions build_of(const Camera& camera) {
  return BuildOptions().define("CAMERA_MODEL", camera_model_number(camera.model));
}

}  // namespace

int camera_model_number(CameraModel model) {
  switch (model) {
    case CameraModel::kPinhole:
      return RS_CAMERA_PINHOLE;
    case CameraModel::kOpenCv:
      return RS_CAMERA_OPENCV;
    case CameraModel::kFisheye:
      return RS_CAMERA_FISHEYE;
    case CameraModel::kEquirectangular:
      return RS_CAMERA_EQUIRECTANGULAR;
    case CameraModel::kOrthographic:
      return RS_CAMERA_ORTHOGRAPHIC;
    case CameraModel::kPhotoLens:
      break;  // refused by require_pixels()
  }
  return RS_CAMERA_PINHOLE;
}

RsLensCamera lens_camera(const Camera& camera, const Lens& lens) {
  RsLensCamera out{};
  const glm::dvec3 center = camera.center();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      out.rotation[3 * row + column] = static_cast<float>(camera.rotation[column][row]);
    }
    out.center[row] = static_cast<float>(center[row]);
  }
  const Distortion& d = camera.distortion;
  out.fx = static_cast<float>(camera.fx);
  out.fy = static_cast<float>(camera.fy);
  out.cx = static_cast<float>(camera.cx);
  out.cy = static_cast<float>(camera.cy);
  out.k1 = static_cast<float>(d.k1);
  out.k2 = static_cast<float>(d.k2);
  out.k3 = static_cast<float>(d.k3);
  if (camera.model == CameraModel::kFisheye) {
    out.k4 = static_cast<float>(d.k4);
  } else {
    out.p1 = static_cast<float>(d.p1);
    out.p2 = static_cast<float>(d.p2);
  }
  const double limit = lens_limit(camera.model, d);
  out.limit = static_cast<float>(limit);
  out.image_limit = static_cast<float>(radial_image(camera.model, d, limit));
  out.aperture = lens.aperture;
  out.focus_distance = lens.focus_distance;
  out.width = camera.width;
  out.height = camera.height;
  out.sample = lens.sample;
  out.seed_lo = static_cast<std::uint32_t>(lens.seed);
  out.seed_hi = static_cast<std::uint32_t>(lens.seed >> 32);
  return out;
}

void require_room(const Camera& camera, const DeviceInfo& device) {
  constexpr double kPixelBytes = 4.0 * sizeof(float);
  const double pixels = static_cast<double>(camera.width) * camera.height;
  if (kPixelBytes * pixels <= static_cast<double>(device.max_allocation)) return;
  throw ResourceError(
      fmt::format("The picture of {} x {} pixels of camera '{}' is too large for {}, of which a "
                  "buffer has {:.0f} MiB at most: ask for a smaller one",
                  camera.width, camera.height, camera.name, device.name,
                  static_cast<double>(device.max_allocation) / (1 << 20)));
}

ColorDirection color_direction(const Camera& camera) {
  return camera.model == CameraModel::kOrthographic ? ColorDirection::kRay
                                                    : ColorDirection::kFromOrigin;
}

std::array<float, 4> depth_axis(const Camera& camera) {
  if (camera.model != CameraModel::kPinhole && camera.model != CameraModel::kOpenCv) return {};
  std::array<float, 4> axis{};
  for (int k = 0; k < 3; ++k) {
    axis[static_cast<std::size_t>(k)] = static_cast<float>(camera.rotation[k][2]);
  }
  return axis;
}

void CameraRays::generate(const Camera& camera,
                          const Lens& lens,
                          std::size_t first_pixel,
                          std::size_t count,
                          Buffer<Ray>& rays) {
  const std::size_t pixels = pixel_count(camera);
  if (first_pixel > pixels || count > pixels - first_pixel || pixels > UINT32_MAX) {
    throw UsageError(
        fmt::format("Rays of the pixels {} to {} cannot be made of a picture of {} x {}: ask for "
                    "pixels inside of it",
                    first_pixel, first_pixel + count, camera.width, camera.height));
  }
  if (rays.size() < count) rays.ensure(context_, count, "camera rays");
  context_.kernel("trace/camera_rays.cl", "camera_rays", build_of(camera))
      .launch(Range::linear(count, kGroup), lens_camera(camera, lens),
              static_cast<std::uint32_t>(first_pixel), static_cast<std::uint32_t>(count), rays);
}

void CameraRays::cones(const Camera& camera,
                       float footprint,
                       const Buffer<Ray>& rays,
                       std::size_t count,
                       Buffer<RsCone>& cones) {
  cones.ensure(context_, count, "cones of camera rays");
  context_.kernel("trace/camera_rays.cl", "camera_cones", build_of(camera))
      .launch(Range::linear(count, kGroup), static_cast<std::uint32_t>(count), depth_axis(camera),
              footprint_width(camera, footprint), rays, cones);
}

}  // namespace raysplats
