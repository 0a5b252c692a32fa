// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/photo_views.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "io/photo/photo_orientation.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/photo_lens.hpp"

namespace raysplats::io {

namespace fs = std::filesystem;

namespace {

/// Image radius at which the lens of a photo of a plane folds back or ends; 0 for others, of which
/// fisheyes may show a circle on purpose.
double folding_radius(const Camera& photo) {
  if (photo.model == CameraModel::kOpenCv)
    return radial_image(photo.model, photo.distortion, lens_limit(photo.model, photo.distortion));
  if (!photo.lens || photo.lens->form != PhotoLens::Form::kPerspective) return 0;
  const double edge = photo.lens->limit * (1 - 1e-9);
  const auto seen = lens_point(*photo.lens, {std::sin(edge), 0.0, std::cos(edge)});
  return seen ? glm::length(*seen) : 0;
}

}  // namespace

void set_cameras(
    View& view, const Camera& nominal, ImageSize photo, double factor, bool undistort) {
  if (!has_shape(photo.width, photo.height, nominal) &&
      has_shape(photo.height, photo.width, nominal) && lies_on_its_side(view.image_path))
    std::swap(photo.width, photo.height);
  const double scale_x = static_cast<double>(photo.width) / nominal.width;
  const double scale_y = static_cast<double>(photo.height) / nominal.height;
  if (!has_shape(photo.width, photo.height, nominal)) {
    throw DataError(fmt::format(
        "The image {} has {} x {} pixels but its camera {} x {}, which is another shape: use the "
        "photos that the cameras belong to",
        view.image_path.string(), photo.width, photo.height, nominal.width, nominal.height));
  }
  view.source_camera = nominal;
  view.source_camera.width = photo.width;
  view.source_camera.height = photo.height;
  view.source_camera.fx *= scale_x;
  view.source_camera.cx *= scale_x;
  view.source_camera.fy *= scale_y;
  view.source_camera.cy *= scale_y;
  require_believable(view.source_camera,
                     fmt::format("The camera of the image {}", view.image_path.string()));
  view.sample_bytes = photo.sample_bytes;
  view.camera = picture_camera(view.source_camera, factor, undistort);
}

Camera picture_camera(const Camera& photo, double factor, bool undistort) {
  Camera out = downscaled(rendered_camera(photo), factor);
  if (undistort && out.model == CameraModel::kOpenCv) {
    out.model = CameraModel::kPinhole;
    out.distortion = {};
  }
  return out;
}

void sort_by_name(std::vector<View>& views) {
  std::stable_sort(views.begin(), views.end(),
                   [](const View& a, const View& b) { return a.camera.name < b.camera.name; });
}

void leave_out_missing(std::size_t missing,
                       std::size_t all,
                       const std::string& what,
                       const std::string& advice) {
  if (2 * missing > all) throw DataError(fmt::format("{}: {}", what, advice));
  spdlog::warn("{}: they are left out", what);
}

void warn_of_folding_lenses(const std::vector<View>& views) {
  std::size_t folding = 0;
  double first_lost = 0;
  fs::path first;
  for (const View& view : views) {
    const Camera& photo = view.source_camera;
    const double radius = folding_radius(photo);
    const double half = 0.5 * std::min(photo.width / photo.fx, photo.height / photo.fy);
    if (!(radius > 0 && radius < half) || folding++ > 0) continue;
    const double circle = std::numbers::pi * radius * radius * photo.fx * photo.fy;
    first_lost = 1 - circle / photo.width / photo.height;
    first = view.image_path;
  }
  if (folding == 0) return;
  spdlog::warn(
      "The lenses of {} of {} photos fold back well within the photo, which loses what is outside "
      "({:.0f} % of {}, the first): correct their distortion, or undistort the images first",
      folding, views.size(), 100 * first_lost, first.string());
}

void warn_of_principal_points(const std::vector<View>& views) {
  constexpr double kFar = 0.2;  // of a side; of intrinsics of half the size it is a quarter
  const auto is_far = [](const View& view) {
    const Camera& photo = view.source_camera;
    return std::abs(photo.cx / photo.width - 0.5) > kFar ||
           std::abs(photo.cy / photo.height - 0.5) > kFar;
  };
  const auto far = std::count_if(views.begin(), views.end(), is_far);
  if (2 * static_cast<std::size_t>(far) <= views.size()) return;
  const Camera& first = std::find_if(views.begin(), views.end(), is_far)->source_camera;
  spdlog::warn(
      "The principal point of {} of {} photos is far from their middle (at {:.0f}, {:.0f} of {} x "
      "{} pixels, the first): unless they are crops, their intrinsics belong to photos of another "
      "size, which the cameras' file must say (w and h of a transforms file)",
      far, views.size(), first.cx, first.cy, first.width, first.height);
}

void refuse_shared_photo(const std::string& first,
                         const std::string& second,
                         const std::string& cameras,
                         const fs::path& photo) {
  throw DataError(fmt::format(
      "The images '{}' and '{}' of {} are both the file {}: keep the photos in the folders that it "
      "names",
      first, second, cameras, photo.string()));
}

void tell_of_extensions(std::size_t reformatted,
                        std::size_t all,
                        const fs::path& cameras,
                        const std::string& first) {
  if (reformatted == 0) return;
  spdlog::info("{} of {} photos have another extension than {} says ('{}')", reformatted, all,
               cameras.string(), first);
}

void tell_of_case(std::size_t respelt,
                  std::size_t all,
                  const fs::path& cameras,
                  const std::string& first) {
  if (respelt == 0) return;
  spdlog::info(
      "{} of {} photos are spelt otherwise than in {} ('{}') and differ in letter case or in "
      "how accents are written",
      respelt, all, cameras.string(), first);
}

}  // namespace raysplats::io
