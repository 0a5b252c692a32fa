// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/transforms_views.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/dataset/find_image.hpp"
#include "io/dataset/photo_views.hpp"
#include "io/dataset/transforms_camera.hpp"
#include "io/image/image_file.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// The photo of a frame.
struct FramePhoto {
  fs::path path;
  bool moved = false;        ///< found by the end of its name
  bool respelt = false;      ///< in other letter case
  bool reformatted = false;  ///< with another extension
};

/// ScanNet++ has its files in a folder "nerfstudio" and what they name in others beside it: the
/// folder of one kind.
struct ScanNetFolder {
  const char* of_lens;      ///< of transforms.json
  const char* undistorted;  ///< of transforms_undistorted.json

  fs::path of(const TransformsFile& file) const {
    const fs::path folder = fs::absolute(file.path).lexically_normal().parent_path();
    if (folder.filename() != "nerfstudio") return {};
    return folder.parent_path() / (file.path.stem() == "transforms" ? of_lens : undistorted);
  }
};
constexpr ScanNetFolder kScanNetPhotos{"resized_images", "resized_undistorted_images"};
constexpr ScanNetFolder kScanNetMasks{"resized_anon_masks", "resized_undistorted_masks"};

std::optional<FramePhoto> frame_photo(const TransformsFile& file,
                                      const TransformsFrame& frame,
                                      RespeltFinder& respelt) {
  const fs::path folder = file.path.parent_path();
  if (frame.file_path.empty()) {
    throw DataError(fmt::format("{}: frame {} has no file_path", file.path.string(), frame.number));
  }
  if (auto photo = find_image(folder, frame.file_path)) return FramePhoto{*photo};
  if (auto photo = respelt.find(folder, frame.file_path)) return FramePhoto{*photo, false, true};
  if (const fs::path beside = kScanNetPhotos.of(file); !beside.empty()) {
    if (auto photo = find_image(beside, frame.file_path)) return FramePhoto{*photo};
  }
  if (auto photo = find_moved(folder, frame.file_path, 1)) return FramePhoto{*photo, true};
  if (auto photo = find_reformatted(folder, frame.file_path))
    return FramePhoto{*photo, false, false, true};
  return std::nullopt;
}

/// Whether two names of files can be of one: the whole of one is the end of the other, and says in
/// which folder the file lies.
bool may_be_same(const std::string& a, const std::string& b) {
  const auto path_of = [](const std::string& name) {
    return fs::path(inner_name(name)).replace_extension().generic_string();
  };
  const std::string x = path_of(a), y = path_of(b);
  const std::string &end = x.size() < y.size() ? x : y, &whole = x.size() < y.size() ? y : x;
  if (x == y) return true;
  return end.find('/') != std::string::npos && whole.ends_with("/" + end);
}

/// The photos that frames have where they say, and the name that says so.
std::map<fs::path, std::string> photos_in_place(
    const TransformsFile& file, const std::vector<std::optional<FramePhoto>>& photos) {
  std::map<fs::path, std::string> out;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (photos[i] && !photos[i]->moved && !photos[i]->reformatted)
      out.emplace(photos[i]->path, file.frames[i].file_path);
  }
  return out;
}

/// What frames name as masks and depth maps: the photo of none.
std::set<fs::path> other_pictures(const TransformsFile& file) {
  std::set<fs::path> out;
  for (const TransformsFrame& frame : file.frames) {
    for (const std::string& name : {frame.mask_path, frame.depth_path}) {
      if (!name.empty())
        out.insert(find_beside(file.path.parent_path(), name, 2).lexically_normal());
    }
  }
  return out;
}

/// The photos of a file's frames; frames without one leave the file. A photo that is where another
/// frame says is none that was moved or converted: that of a frame which finds no other is missing.
std::vector<FramePhoto> frame_photos(TransformsFile& file) {
  std::vector<FramePhoto> photos;
  std::vector<TransformsFrame> found, missing;
  std::vector<std::optional<FramePhoto>> hits;
  RespeltFinder respelt;
  for (const TransformsFrame& frame : file.frames)
    hits.push_back(frame_photo(file, frame, respelt));
  const std::map<fs::path, std::string> in_place = photos_in_place(file, hits);
  const std::set<fs::path> others = other_pictures(file);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    TransformsFrame& frame = file.frames[i];
    std::optional<FramePhoto>& photo = hits[i];
    if (photo && photo->reformatted &&
        (in_place.contains(photo->path) || others.contains(photo->path.lexically_normal())))
      photo.reset();
    if (photo && photo->moved) {
      const auto owner = in_place.find(photo->path);
      if (owner != in_place.end() && !may_be_same(owner->second, frame.file_path)) photo.reset();
    }
    if (photo) {
      frame.photo = photo->path;
      frame.moved = photo->moved;
      photos.push_back(*photo);
    }
    (photo ? found : missing).push_back(std::move(frame));
  }
  file.frames = std::move(found);
  if (missing.empty()) return photos;
  const std::string what =
      fmt::format("{}: the photos of {} of {} frames do not exist, '{}' of frame {} among them",
                  file.path.string(), missing.size(), missing.size() + photos.size(),
                  missing.front().file_path, missing.front().number);
  leave_out_missing(missing.size(), missing.size() + photos.size(), what,
                    "put them where file_path says, counted from the file's folder");
  return photos;
}

/// The focal length across that the angle of a frame says, in pixels of its camera, where the
/// camera has clearly another one; 0 otherwise. Angles are those of planes alone.
double other_focal_length(const TransformsFrame& frame, const Camera& camera) {
  constexpr double kClearly = 1.2;
  if (!frame.fx || !frame.angle_x || frame.model != CameraModel::kPinhole) return 0;
  const double focal =
      0.5 * camera.width / std::tan(0.5 * std::min(*frame.angle_x, std::numbers::pi));
  return std::max(focal, camera.fx) > kClearly * std::min(focal, camera.fx) ? focal : 0;
}

/// Of a file in which `contradicting` of all frames have two focal lengths.
void warn_of_angles(const TransformsFile& file,
                    std::size_t contradicting,
                    double focal,
                    double angle_focal) {
  if (contradicting == 0) return;
  spdlog::warn(
      "{}: fl_x and camera_angle_x contradict each other in {} of {} frames ({:.0f} and {:.0f} "
      "pixels, the first): fl_x counts, which may be of photos of another size (w and h say it)",
      file.path.string(), contradicting, file.frames.size(), focal, angle_focal);
}

/// The mask or depth map `path` of a frame, in the file's folder or `other`, if there is one. Its
/// folder tells it from the photo of the same name.
fs::path named_by(const TransformsFile& file,
                  const TransformsFrame& frame,
                  const char* what,
                  const std::string& path,
                  const fs::path& other) {
  fs::path found = find_beside(file.path.parent_path(), path, 2);
  if (!other.empty() && !is_file(found)) found = other / path;
  if (!is_file(found)) {
    throw DataError(fmt::format("{}: the {} '{}' of frame {} does not exist", file.path.string(),
                                what, path, frame.number));
  }
  return found;
}

}  // namespace

bool has_photos(const TransformsFile& file) {
  RespeltFinder respelt;
  return std::any_of(file.frames.begin(), file.frames.end(), [&](const TransformsFrame& frame) {
    return frame_photo(file, frame, respelt).has_value();
  });
}

void add_photos(const TransformsFile& file, MaskFinder& masks) {
  for (const TransformsFrame& frame : file.frames) {
    const fs::path name = frame.file_path;
    // What follows a point is a part of names without an extension.
    masks.add(has_image_extension(name) ? name : fs::path(name.string() + ".png"));
  }
}

std::vector<View> transforms_views(TransformsFile& file,
                                   const DatasetOptions& options,
                                   const MaskFinder& masks) {
  const fs::path folder = file.path.parent_path();
  const fs::path masks_beside = kScanNetMasks.of(file);
  const std::vector<FramePhoto> photos = frame_photos(file);
  std::vector<View> views;
  std::size_t moved = 0, respelt = 0, reformatted = 0, contradicting = 0;
  std::string first_moved, first_respelt, first_reformatted;
  double first_focal = 0, first_angle_focal = 0;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const TransformsFrame& frame = file.frames[i];
    const fs::path& photo = photos[i].path;
    View view;
    view.image_path = photo;
    fs::path name = frame.file_path;
    if (photos[i].moved) {
      name = photo.lexically_relative(folder.lexically_normal());
      // Where a link and ".." lead to the folder, find_image() says its own name.
      if (name.empty() || *name.begin() == "..")
        name = photo.lexically_relative(fs::canonical(folder));
      if (moved++ == 0) first_moved = frame.file_path;
    }
    if (photos[i].respelt && respelt++ == 0) first_respelt = frame.file_path;
    if (photos[i].reformatted && reformatted++ == 0) first_reformatted = frame.file_path;
    if (!has_image_extension(name)) name += photo.extension();
    view.mask_path = frame.mask_path.empty()
                         ? masks.find(name, photo)
                         : named_by(file, frame, "mask", frame.mask_path, masks_beside);
    if (!frame.depth_path.empty())
      view.depth_path = named_by(file, frame, "depth map", frame.depth_path, {});
    const ImageSize size = image_size(photo);
    Camera nominal =
        frame_camera(file, i, frame.width.value_or(size.width), frame.height.value_or(size.height));
    nominal.name = inner_name(name);
    if (const double focal = other_focal_length(frame, nominal);
        focal > 0 && contradicting++ == 0) {
      first_focal = nominal.fx;
      first_angle_focal = focal;
    }
    set_cameras(view, nominal, size, options.downscale, options.undistort);
    views.push_back(std::move(view));
  }
  warn_of_angles(file, contradicting, first_focal, first_angle_focal);
  if (moved > 0) {
    spdlog::info("{} of {} photos are not where {} says ({}) but were found below its folder",
                 moved, views.size(), file.path.string(), first_moved);
  }
  tell_of_extensions(reformatted, views.size(), file.path, first_reformatted);
  tell_of_case(respelt, views.size(), file.path, first_respelt);
  return views;
}

void require_photos_of_their_own(const std::vector<const TransformsFile*>& files) {
  std::map<fs::path, const TransformsFrame*> owners;
  for (const TransformsFile* file : files) {
    for (const TransformsFrame& frame : file->frames) {
      const auto [owner, is_new] = owners.emplace(frame.photo, &frame);
      const TransformsFrame& first = *owner->second;
      if (is_new || !(first.moved || frame.moved)) continue;
      if (may_be_same(first.file_path, frame.file_path)) continue;
      refuse_shared_photo(first.file_path, frame.file_path, file->path.string(), frame.photo);
    }
  }
}

}  // namespace raysplats::io
