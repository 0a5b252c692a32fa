// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/colmap_views.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "io/dataset/dataset_advice.hpp"
#include "io/dataset/find_image.hpp"
#include "io/dataset/photo_folder.hpp"
#include "io/dataset/photo_views.hpp"
#include "io/dataset/transforms.hpp"
#include "io/image/image_file.hpp"
#include "io/photo/photo_mask.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// Photos of nearly the camera's size were not made smaller: most often they are those from before
/// their distortion was taken out, which leaves another size.
bool is_stretched(const ImageSize& photo, const Camera& nominal) {
  constexpr double kNearly = 0.15;
  const int pixels =
      std::max(std::abs(photo.width - nominal.width), std::abs(photo.height - nominal.height));
  return pixels > 2 && std::abs(photo.width - nominal.width) < kNearly * nominal.width;
}

/// Two poses cannot share a photo.
void require_photos_of_their_own(const std::vector<View>& views) {
  std::map<fs::path, const View*> owners;
  for (const View& view : views) {
    const auto [owner, is_new] = owners.emplace(view.image_path, &view);
    if (is_new) continue;
    refuse_shared_photo(owner->second->camera.name, view.camera.name, "the COLMAP model",
                        view.image_path);
  }
}

void tell_of_stretched(std::size_t stretched, const std::vector<View>& views) {
  if (stretched == 0) return;
  const Camera& camera = views.front().source_camera;
  spdlog::warn(
      "{} of {} photos have not the size of their camera but nearly ({} x {} pixels, the first) "
      "and are stretched to it: use the photos that the model was made of",
      stretched, views.size(), camera.width, camera.height);
}

/// What to do about photos that are not there. A part of a data set may have been given for it.
std::string advice_on_photos(const fs::path& root) {
  const std::optional<fs::path> whole = enclosing_data_set(root);
  return whole ? fmt::format("put them there, or give {}, which is a data set", whole->string())
               : "put them there";
}

}  // namespace

std::vector<View> colmap_views(const ColmapModel& model,
                               const fs::path& model_folder,
                               const fs::path& root,
                               const DatasetOptions& options) {
  const PhotoFolder folder = photo_folder(root, model, options.downscale);
  const double rest = std::max(1.0, options.downscale / folder.factor);
  MaskFinder masks(root);
  for (const ColmapImage& image : model.images) masks.add(image.name);
  std::vector<View> views;
  std::size_t stretched = 0, respelt = 0, reformatted = 0;
  RespeltFinder respelt_photos;
  std::string first_respelt, first_reformatted;
  std::vector<std::string> missing;
  for (const ColmapImage& image : model.images) {
    View view;
    const auto photo = find_photo(folder.path, image.name, respelt_photos);
    if (!photo) {
      missing.push_back(image.name);
      continue;
    }
    if (photo->respelt && respelt++ == 0) first_respelt = image.name;
    if (photo->reformatted && reformatted++ == 0) first_reformatted = image.name;
    view.image_path = photo->path;
    view.mask_path = masks.find(image.name, photo->path);
    view.points = image.points;
    Camera nominal = model.cameras.at(image.camera_id);
    nominal.name = inner_name(image.name);
    nominal.rotation = image.rotation;
    nominal.translation = image.translation;
    const ImageSize size = image_size(view.image_path);
    if (is_stretched(size, nominal)) ++stretched;
    set_cameras(view, nominal, size, rest, options.undistort);
    views.push_back(std::move(view));
  }
  if (!missing.empty()) {
    leave_out_missing(
        missing.size(), model.images.size(),
        fmt::format("{} of {} images of the COLMAP model {} are not in {}, '{}' among them",
                    missing.size(), model.images.size(), model_folder.string(),
                    folder.path.string(), missing.front()),
        advice_on_photos(root));
  }
  require_photos_of_their_own(views);
  tell_of_extensions(reformatted, views.size(), model_folder, first_reformatted);
  tell_of_case(respelt, views.size(), model_folder, first_respelt);
  tell_of_stretched(stretched, views);
  return views;
}

}  // namespace raysplats::io
