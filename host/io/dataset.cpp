// SPDX-License-Identifier: Apache-2.0
#include "raysplats/dataset.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>

#include "io/colmap_model.hpp"
#include "io/color_profiles.hpp"
#include "io/cut_out.hpp"
#include "io/data_origin.hpp"
#include "io/find_image.hpp"
#include "io/image_file.hpp"
#include "io/llff.hpp"
#include "io/photo_folder.hpp"
#include "io/photo_mask.hpp"
#include "io/photo_turn.hpp"
#include "io/ply_points.hpp"
#include "io/polycam.hpp"
#include "io/transforms.hpp"
#include "io/way_out.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/camera_check.hpp"
#include "scene/photo_lens.hpp"
#include "util/file_kind.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

/// Photos of nearly the camera's size were not made smaller: most often they are those from before
/// their distortion was taken out, which leaves another size.
bool is_stretched(const io::ImageSize& photo, const Camera& nominal) {
  constexpr double kNearly = 0.15;
  const int pixels =
      std::max(std::abs(photo.width - nominal.width), std::abs(photo.height - nominal.height));
  return pixels > 2 && std::abs(photo.width - nominal.width) < kNearly * nominal.width;
}

/// Sets the cameras of a view: `nominal` is the camera at the size that its model states, the photo
/// may have another (reduced copies, rounding by a pixel) or lie on its side (photo_turn.hpp), and
/// is used reduced by `factor`.
void set_cameras(
    View& view, const Camera& nominal, io::ImageSize photo, double factor, bool undistort) {
  if (!io::has_shape(photo.width, photo.height, nominal) &&
      io::has_shape(photo.height, photo.width, nominal) && io::lies_on_its_side(view.image_path))
    std::swap(photo.width, photo.height);
  const double scale_x = static_cast<double>(photo.width) / nominal.width;
  const double scale_y = static_cast<double>(photo.height) / nominal.height;
  if (!io::has_shape(photo.width, photo.height, nominal)) {
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
  view.camera = downscaled(rendered_camera(view.source_camera), factor);
  if (undistort && view.camera.model == CameraModel::kOpenCv) {
    view.camera.model = CameraModel::kPinhole;
    view.camera.distortion = {};
  }
}

void mark_every(std::vector<View>& views, int test_every) {
  if (test_every <= 0) return;
  if (views.size() == 1 && test_every > 1) return;  // a photo alone is trained on
  const auto step = static_cast<std::size_t>(test_every);
  for (std::size_t i = 0; i < views.size(); i += step) views[i].test = true;
}

/// Counts all positions from the origin that the options or the scene say; `points`: of
/// dataset.points, as precise as in their file.
void set_origin(Dataset& dataset, std::span<const double> points, const DatasetOptions& options) {
  glm::dvec3 origin;
  if (options.origin) {
    const std::array<double, 3>& o = *options.origin;
    origin = {o[0], o[1], o[2]};
  } else {
    origin = io::fitting_origin(dataset.views, points);
  }
  if (origin == glm::dvec3(0.0)) return;
  spdlog::info(
      "positions count from {}, {}, {}: the scene lies far from the origin of its files, where "
      "single precision would blur it",
      origin.x, origin.y, origin.z);
  dataset.origin = {origin.x, origin.y, origin.z};
  for (View& view : dataset.views) {
    io::move_origin(view.camera, origin);
    io::move_origin(view.source_camera, origin);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    dataset.points.positions[i] = static_cast<float>(points[i] - origin[static_cast<int>(i % 3)]);
  }
}

void sort_by_name(std::vector<View>& views) {
  std::stable_sort(views.begin(), views.end(),
                   [](const View& a, const View& b) { return a.camera.name < b.camera.name; });
}

/// Poses without a photo, as those of blurred photos that were deleted, are left out with a
/// warning; where most have none, it is the folder that is wrong.
void leave_out_missing(std::size_t missing,
                       std::size_t all,
                       const std::string& what,
                       const std::string& advice) {
  if (2 * missing > all) throw DataError(fmt::format("{}: {}", what, advice));
  spdlog::warn("{}: they are left out", what);
}

/// Two poses cannot share a photo.
void require_photos_of_their_own(const std::vector<View>& views) {
  std::map<fs::path, const View*> owners;
  for (const View& view : views) {
    const auto [owner, is_new] = owners.emplace(view.image_path, &view);
    if (is_new) continue;
    throw DataError(fmt::format(
        "The images '{}' and '{}' of the COLMAP model are both the file {}: keep the photos in "
        "the folders that the model names",
        owner->second->camera.name, view.camera.name, view.image_path.string()));
  }
}

void warn_of_repeated_photos(const std::vector<View>& views) {
  std::set<fs::path> seen;
  std::size_t repeated = 0;
  fs::path first;
  for (const View& view : views) {
    if (seen.insert(view.image_path).second) continue;
    if (repeated++ == 0) first = view.image_path;
  }
  if (repeated == 0) return;
  spdlog::warn("{} photos appear in more than one frame, {} among them", repeated, first.string());
}

/// Photos whose names another system wrote, to which letter case is all the same.
void tell_of_case(std::size_t respelt,
                  std::size_t all,
                  const fs::path& cameras,
                  const std::string& first) {
  if (respelt == 0) return;
  spdlog::info("{} of {} photos are spelt otherwise than in {} ('{}') and differ in letter case",
               respelt, all, cameras.string(), first);
}

Dataset load_colmap(const fs::path& root,
                    const fs::path& model_folder,
                    const DatasetOptions& options) {
  io::ColmapModel model = io::read_colmap_model(model_folder);
  Dataset dataset;
  dataset.kind = DatasetKind::kColmap;
  dataset.points = std::move(model.points);
  const io::PhotoFolder folder = io::photo_folder(root, model, options.downscale);
  const double rest = std::max(1.0, options.downscale / folder.factor);
  std::size_t stretched = 0, respelt = 0;
  std::string first_respelt;
  std::vector<std::string> missing;
  for (const io::ColmapImage& image : model.images) {
    View view;
    auto photo = io::find_photo(folder.path, image.name);
    if (!photo && (photo = io::find_respelt(folder.path, image.name)) && respelt++ == 0)
      first_respelt = image.name;
    if (!photo) {
      missing.push_back(image.name);
      continue;
    }
    view.image_path = *photo;
    view.mask_path = io::find_mask(root, image.name);
    view.points = image.points;
    Camera nominal = model.cameras.at(image.camera_id);
    nominal.name = io::inner_name(image.name);
    nominal.rotation = image.rotation;
    nominal.translation = image.translation;
    const io::ImageSize size = io::image_size(view.image_path);
    if (is_stretched(size, nominal)) ++stretched;
    set_cameras(view, nominal, size, rest, options.undistort);
    dataset.views.push_back(std::move(view));
  }
  if (!missing.empty()) {
    leave_out_missing(
        missing.size(), model.images.size(),
        fmt::format("{} of {} images of the COLMAP model {} are not in {}, '{}' among them",
                    missing.size(), model.images.size(), model_folder.string(),
                    folder.path.string(), missing.front()),
        "put them there");
  }
  require_photos_of_their_own(dataset.views);
  tell_of_case(respelt, dataset.views.size(), model_folder, first_respelt);
  if (stretched > 0) {
    const View& view = dataset.views.front();
    spdlog::warn(
        "{} of {} photos have not the size of their camera but nearly ({} x {} pixels, the first) "
        "and are stretched to it: use the photos that the model was made of",
        stretched, dataset.views.size(), view.source_camera.width, view.source_camera.height);
  }
  sort_by_name(dataset.views);
  mark_every(dataset.views, options.test_every);
  set_origin(dataset, model.positions, options);
  return dataset;
}

/// A mask or depth map of a transforms file. Its folder tells it from the photo of the same name.
fs::path beside_photos(const fs::path& folder, const std::string& path) {
  if (is_file(folder / path)) return folder / path;
  return io::find_moved(folder, path, 2).value_or(folder / path);
}

/// The photo of a frame.
struct FramePhoto {
  fs::path path;
  bool moved = false;    ///< found by the end of its name
  bool respelt = false;  ///< in other letter case
};

std::optional<FramePhoto> frame_photo(const io::TransformsFile& file,
                                      const io::TransformsFrame& frame) {
  const fs::path folder = file.path.parent_path();
  if (frame.file_path.empty()) {
    throw DataError(fmt::format("{}: frame {} has no file_path", file.path.string(), frame.number));
  }
  if (auto photo = io::find_image(folder, frame.file_path)) return FramePhoto{*photo};
  if (auto photo = io::find_respelt(folder, frame.file_path))
    return FramePhoto{*photo, false, true};
  if (auto photo = io::find_moved(folder, frame.file_path, 1)) return FramePhoto{*photo, true};
  return std::nullopt;
}

/// The photos of a file's frames; frames without one leave the file.
std::vector<FramePhoto> frame_photos(io::TransformsFile& file) {
  std::vector<FramePhoto> photos;
  std::vector<io::TransformsFrame> found, missing;
  for (io::TransformsFrame& frame : file.frames) {
    const auto photo = frame_photo(file, frame);
    (photo ? found : missing).push_back(std::move(frame));
    if (photo) photos.push_back(*photo);
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

/// The views of a transforms file, in its order; takes the frames out of it that have none.
std::vector<View> transforms_views(io::TransformsFile& file, const DatasetOptions& options) {
  const fs::path folder = file.path.parent_path();
  const std::vector<FramePhoto> photos = frame_photos(file);
  std::vector<View> views;
  std::size_t moved = 0, respelt = 0;
  std::string first_moved, first_respelt;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const io::TransformsFrame& frame = file.frames[i];
    const fs::path& photo = photos[i].path;
    View view;
    view.image_path = photo;
    fs::path name = frame.file_path;
    if (photos[i].moved) {
      name = photo.lexically_relative(folder.lexically_normal());
      if (moved++ == 0) first_moved = frame.file_path;
    }
    if (photos[i].respelt && respelt++ == 0) first_respelt = frame.file_path;
    if (!io::has_image_extension(name)) name += photo.extension();
    if (!frame.mask_path.empty()) {
      view.mask_path = beside_photos(folder, frame.mask_path);
      if (!is_file(view.mask_path)) {
        throw DataError(fmt::format("{}: the mask '{}' of frame {} does not exist",
                                    file.path.string(), frame.mask_path, frame.number));
      }
    } else {
      // Names may repeat in several folders (train/r_0, test/r_0).
      view.mask_path = io::find_mask(folder, io::inner_name(name));
      if (view.mask_path.empty()) view.mask_path = io::find_mask(folder, photo.filename());
    }
    if (!frame.depth_path.empty()) {
      view.depth_path = beside_photos(folder, frame.depth_path);
      if (!is_file(view.depth_path)) {
        throw DataError(fmt::format("{}: the depth map '{}' of frame {} does not exist",
                                    file.path.string(), frame.depth_path, frame.number));
      }
    }
    const io::ImageSize size = io::image_size(photo);
    Camera nominal = io::frame_camera(file, i, frame.width.value_or(size.width),
                                      frame.height.value_or(size.height));
    nominal.name = io::inner_name(name);
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

/// Gives the data set the points of a PLY; returns their positions as precise as they are there.
std::vector<double> take_points(Dataset& dataset, const fs::path& path) {
  io::PlyPoints points = io::read_ply_points(path);
  dataset.points = std::move(points.cloud);
  return std::move(points.positions);
}

Dataset load_blender(const fs::path& root, const DatasetOptions& options) {
  Dataset dataset;
  dataset.kind = DatasetKind::kBlender;
  // Where 3DGS looks for points, and exporters of Blender leave them.
  std::vector<double> points;
  if (const fs::path file = root / "points3d.ply"; is_file(file)) {
    points = take_points(dataset, file);
    spdlog::info("{} points are those of {}", dataset.points.size(), file.string());
  }
  io::TransformsFile train = io::read_transforms(root / "transforms_train.json");
  dataset.views = transforms_views(train, options);
  sort_by_name(dataset.views);
  std::optional<fs::path> held_out;
  for (const char* name : {"transforms_val.json", "transforms_test.json"}) {
    if (is_file(root / name)) held_out = root / name;
  }
  if (!held_out) {
    mark_every(dataset.views, options.test_every);
    set_origin(dataset, points, options);
    return dataset;
  }
  io::TransformsFile test_file = io::read_transforms(*held_out);
  std::vector<View> test = transforms_views(test_file, options);
  sort_by_name(test);
  for (View& view : test) {
    view.test = true;
    dataset.views.push_back(std::move(view));
  }
  set_origin(dataset, points, options);
  return dataset;
}

/// Says which frames of a nerfstudio file its lists leave out, and which names are of none of its
/// `frames`, with or without a photo.
void tell_of_lists(const io::TransformsFile& file,
                   const std::set<std::string>& frames,
                   const std::set<std::string>& train,
                   const std::set<std::string>& test,
                   std::size_t used) {
  std::size_t unknown = 0;
  std::string first;
  for (const std::set<std::string>* list : {&train, &test}) {
    for (const std::string& name : *list) {
      if (frames.contains(name)) continue;
      if (unknown++ == 0) first = name;
    }
  }
  if (unknown > 0) {
    spdlog::warn(
        "{}: {} of {} names in train_filenames, val_filenames and test_filenames are of no frame, "
        "'{}' among them: write them as the frames' file_path",
        file.path.string(), unknown, train.size() + test.size(), first);
  }
  if (used < file.frames.size()) {
    spdlog::info("{} of {} frames of {} are in none of its lists and left out",
                 file.frames.size() - used, file.frames.size(), file.path.string());
  }
}

Dataset load_nerfstudio(const fs::path& root, const DatasetOptions& options) {
  io::TransformsFile file = io::read_transforms(root / "transforms.json");
  Dataset dataset;
  dataset.kind = DatasetKind::kNerfstudio;
  std::set<std::string> frames;
  for (const io::TransformsFrame& frame : file.frames)
    frames.insert(io::inner_name(frame.file_path));
  std::vector<View> views = transforms_views(file, options);
  const auto names = [&](const std::optional<std::vector<std::string>>& list) {
    std::set<std::string> set;
    for (const std::string& name : list.value_or(std::vector<std::string>{}))
      set.insert(io::inner_name(name));
    return set;
  };
  const std::set<std::string> train = names(file.train_filenames);
  const std::set<std::string> test =
      names(file.test_filenames ? file.test_filenames : file.val_filenames);
  if (train.empty() && test.empty()) {
    sort_by_name(views);
    mark_every(views, options.test_every);
    dataset.views = std::move(views);
  } else {
    for (std::size_t i = 0; i < views.size(); ++i) {
      const std::string name = io::inner_name(file.frames[i].file_path);
      views[i].test = test.contains(name) || (test.empty() && !train.contains(name));
      // Frames that the file assigns to neither side are left out.
      if (views[i].test || train.empty() || train.contains(name))
        dataset.views.push_back(std::move(views[i]));
    }
    tell_of_lists(file, frames, train, test, dataset.views.size());
    sort_by_name(dataset.views);
  }
  std::vector<double> points;
  if (!file.ply_file_path.empty()) points = take_points(dataset, root / file.ply_file_path);
  set_origin(dataset, points, options);
  return dataset;
}

/// A data set of frames that are all there is.
Dataset load_frames(DatasetKind kind, io::TransformsFile file, const DatasetOptions& options) {
  Dataset dataset;
  dataset.kind = kind;
  dataset.views = transforms_views(file, options);
  sort_by_name(dataset.views);
  mark_every(dataset.views, options.test_every);
  set_origin(dataset, {}, options);
  return dataset;
}

Dataset load_llff(const fs::path& root, DatasetOptions options) {
  const io::PhotoFolder folder = io::usual_photo_folder(root, options.downscale);
  options.downscale = std::max(1.0, options.downscale / folder.factor);
  return load_frames(DatasetKind::kLlff, io::read_llff(root / io::kLlffPoses, folder.path),
                     options);
}

/// Whether what is transparent in the photos is background.
bool shows_cut_outs(const Dataset& dataset, AlphaUse use) {
  if (use != AlphaUse::kAuto) return use == AlphaUse::kCutout;
  const io::Transparency found = io::transparency(dataset.views);
  // Rendered photos have no lens that leaves a border.
  if (dataset.kind == DatasetKind::kBlender) return found != io::Transparency::kNone;
  if (found == io::Transparency::kBorder) {
    spdlog::info(
        "All photos are transparent in the same places, as at the edge of a lens: these do not "
        "count (alpha = cutout makes them background)");
  }
  if (found == io::Transparency::kCutOut) {
    spdlog::info(
        "The photos are cut out: what is transparent in them is background (with alpha = ignore "
        "it does not count)");
  }
  return found == io::Transparency::kCutOut;
}

/// What nerfstudio makes of a capture has COLMAP's model in a folder of its own. Its file says more
/// (masks, depth maps, lists), and where it names points there is nothing that the model has more.
bool goes_before(const fs::path& transforms, const fs::path& root, const fs::path& model) {
  return model.lexically_relative(root / "colmap").begin()->string() != ".." &&
         !io::read_transforms(transforms).ply_file_path.empty();
}

Dataset load_any(const fs::path& root, const DatasetOptions& options) {
  const fs::path transforms = root / "transforms.json";
  if (const auto model = io::find_colmap_model(root)) {
    if (is_file(transforms)) {
      if (goes_before(transforms, root, *model)) {
        spdlog::info("{} is read, not the COLMAP model {}", transforms.string(), model->string());
        return load_nerfstudio(root, options);
      }
      spdlog::info("the COLMAP model {} is read, {} beside it is not", model->string(),
                   transforms.string());
    }
    return load_colmap(root, *model, options);
  }
  if (is_file(transforms)) return load_nerfstudio(root, options);
  if (is_file(root / "transforms_train.json")) return load_blender(root, options);
  if (is_file(root / io::kLlffPoses)) return load_llff(root, options);
  if (const auto polycam = io::find_polycam(root))
    return load_frames(DatasetKind::kPolycam, io::read_polycam(*polycam, root), options);
  throw DataError(
      fmt::format("{} is no data set: it has neither a COLMAP model (sparse/0) nor transforms.json "
                  "nor transforms_train.json nor poses_bounds.npy (LLFF) nor keyframes/cameras "
                  "(Polycam){}",
                  root.string(), io::way_out(root)));
}

}  // namespace

std::vector<std::size_t> Dataset::indices(Split split) const {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (split == Split::kAll || views[i].test == (split == Split::kTest)) out.push_back(i);
  }
  return out;
}

Dataset load_dataset(const fs::path& path, const DatasetOptions& options) {
  if (!(options.downscale >= 1 && options.downscale <= 1024)) {
    throw UsageError(fmt::format("The downscale factor is {}: it must lie between 1 and 1024",
                                 options.downscale));
  }
  if (options.test_every < 0) {
    throw UsageError(
        fmt::format("The test interval is {}: it must be 0 or more", options.test_every));
  }
  // The file of cameras stands for its folder.
  const std::string name = path.filename().string();
  const bool names_cameras = name.starts_with("transforms") && path.extension() == ".json";
  const fs::path root = names_cameras && is_file(path) ? fs::absolute(path).parent_path() : path;
  if (!is_folder(root)) {
    throw DataError(fmt::format("The data set {} {}: give the folder of a data set", root.string(),
                                is_file(root) ? "is a file" : "does not exist"));
  }
  Dataset dataset = load_any(root, options);
  dataset.root = root;
  if (dataset.views.empty()) {
    throw DataError(
        fmt::format("The data set {} has no views: there is nothing to train on", root.string()));
  }
  warn_of_repeated_photos(dataset.views);
  io::warn_of_color_profiles(dataset.views);
  dataset.alpha_is_background = shows_cut_outs(dataset, options.alpha);
  const auto has_mask = [](const View& view) { return !view.mask_path.empty(); };
  const auto masked = std::count_if(dataset.views.begin(), dataset.views.end(), has_mask);
  if (const fs::path masks = io::mask_folder(root); masked == 0 && is_folder(masks)) {
    spdlog::warn(
        "No mask in {} has the name of a photo: {} would have {}.png, {}.png or {}_mask.png",
        masks.string(), dataset.views.front().camera.name, dataset.views.front().camera.name,
        fs::path(dataset.views.front().camera.name).replace_extension().string(),
        fs::path(dataset.views.front().camera.name).replace_extension().string());
  }
  if (masked > 0) {
    for (const View& view : dataset.views) {
      if (has_mask(view)) io::check_mask(view);
    }
    const bool ignores = options.masks == MaskUse::kIgnore;
    if (!ignores) dataset.alpha_is_background = true;
    for (View& view : dataset.views)
      view.mask_apart = ignores && dataset.alpha_is_background && has_mask(view);
    const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), has_mask);
    spdlog::info("{} of {} photos have a mask, as {}: what is black there {}", masked,
                 dataset.views.size(), first->mask_path.string(),
                 ignores ? "does not count" : "is background");
  }
  return dataset;
}

}  // namespace raysplats
