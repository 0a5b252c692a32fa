// SPDX-License-Identifier: Apache-2.0
#include "io/transforms_views.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/find_image.hpp"
#include "io/image_file.hpp"
#include "io/photo_views.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// The photo of a frame.
struct FramePhoto {
  fs::path path;
  bool moved = false;    ///< found by the end of its name
  bool respelt = false;  ///< in other letter case
};

std::optional<FramePhoto> frame_photo(const TransformsFile& file, const TransformsFrame& frame) {
  const fs::path folder = file.path.parent_path();
  if (frame.file_path.empty()) {
    throw DataError(fmt::format("{}: frame {} has no file_path", file.path.string(), frame.number));
  }
  if (auto photo = find_image(folder, frame.file_path)) return FramePhoto{*photo};
  if (auto photo = find_respelt(folder, frame.file_path)) return FramePhoto{*photo, false, true};
  if (auto photo = find_moved(folder, frame.file_path, 1)) return FramePhoto{*photo, true};
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
    if (photos[i] && !photos[i]->moved) out.emplace(photos[i]->path, file.frames[i].file_path);
  }
  return out;
}

/// The photos of a file's frames; frames without one leave the file. A photo that is where another
/// frame says is none that was moved: that of a frame which finds no other is missing.
std::vector<FramePhoto> frame_photos(TransformsFile& file) {
  std::vector<FramePhoto> photos;
  std::vector<TransformsFrame> found, missing;
  std::vector<std::optional<FramePhoto>> hits;
  for (const TransformsFrame& frame : file.frames) hits.push_back(frame_photo(file, frame));
  const std::map<fs::path, std::string> in_place = photos_in_place(file, hits);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    TransformsFrame& frame = file.frames[i];
    std::optional<FramePhoto>& photo = hits[i];
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

/// The mask or depth map `path` of a frame. Its folder tells it from the photo of the same name.
fs::path named_by(const TransformsFile& file,
                  const TransformsFrame& frame,
                  const char* what,
                  const std::string& path) {
  fs::path found = find_beside(file.path.parent_path(), path, 2);
  if (!is_file(found)) {
    throw DataError(fmt::format("{}: the {} '{}' of frame {} does not exist", file.path.string(),
                                what, path, frame.number));
  }
  return found;
}

}  // namespace

bool has_photos(const TransformsFile& file) {
  return std::any_of(file.frames.begin(), file.frames.end(), [&](const TransformsFrame& frame) {
    return frame_photo(file, frame).has_value();
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
  const std::vector<FramePhoto> photos = frame_photos(file);
  std::vector<View> views;
  std::size_t moved = 0, respelt = 0;
  std::string first_moved, first_respelt;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const TransformsFrame& frame = file.frames[i];
    const fs::path& photo = photos[i].path;
    View view;
    view.image_path = photo;
    fs::path name = frame.file_path;
    if (photos[i].moved) {
      name = photo.lexically_relative(folder.lexically_normal());
      if (moved++ == 0) first_moved = frame.file_path;
    }
    if (photos[i].respelt && respelt++ == 0) first_respelt = frame.file_path;
    if (!has_image_extension(name)) name += photo.extension();
    view.mask_path = frame.mask_path.empty() ? masks.find(name, photo)
                                             : named_by(file, frame, "mask", frame.mask_path);
    if (!frame.depth_path.empty())
      view.depth_path = named_by(file, frame, "depth map", frame.depth_path);
    const ImageSize size = image_size(photo);
    Camera nominal =
        frame_camera(file, i, frame.width.value_or(size.width), frame.height.value_or(size.height));
    nominal.name = inner_name(name);
    set_cameras(view, nominal, size, options.downscale, options.undistort);
    views.push_back(std::move(view));
  }
  if (moved > 0) {
    spdlog::info("{} of {} photos are not where {} says ({}) but were found below its folder",
                 moved, views.size(), file.path.string(), first_moved);
  }
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
