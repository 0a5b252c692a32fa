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

#include "io/colmap_model.hpp"
#include "io/cut_out.hpp"
#include "io/data_origin.hpp"
#include "io/image_file.hpp"
#include "io/photo_turn.hpp"
#include "io/ply_points.hpp"
#include "io/transforms.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/camera_check.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

bool is_folder(const fs::path& path) {
  std::error_code error;
  return fs::is_directory(path, error);
}

bool is_file(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error);
}

/// A mask of the photo `name` in the data set's folder "masks": COLMAP's name.ext.png, stem.png or
/// the same name.
fs::path find_mask(const fs::path& root, const fs::path& name) {
  const fs::path folder = root / "masks";
  if (!is_folder(folder)) return {};
  fs::path stem = name;
  stem.replace_extension();
  for (const fs::path& candidate :
       {fs::path(name.string() + ".png"), fs::path(stem.string() + ".png"),
        fs::path(stem.string() + ".mask.png"), name}) {
    if (is_file(folder / candidate)) return folder / candidate;
  }
  return {};
}

bool has_shape(const io::ImageSize& photo, const Camera& camera) {
  const double expected_height = static_cast<double>(camera.height) * photo.width / camera.width;
  return std::abs(expected_height - photo.height) <= std::max(2.0, 0.02 * photo.height);
}

/// Sets the cameras of a view: `nominal` is the camera at the size that its model states, the photo
/// may have another (reduced copies, rounding by a pixel) or lie on its side (photo_turn.hpp), and
/// is used reduced by `factor`.
void set_cameras(
    View& view, const Camera& nominal, io::ImageSize photo, double factor, bool undistort) {
  if (!has_shape(photo, nominal)) {
    const io::ImageSize turned{photo.height, photo.width, photo.sample_bytes};
    if (has_shape(turned, nominal) && io::lies_on_its_side(view.image_path)) photo = turned;
  }
  const double scale_x = static_cast<double>(photo.width) / nominal.width;
  const double scale_y = static_cast<double>(photo.height) / nominal.height;
  if (!has_shape(photo, nominal)) {
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
  view.camera = downscaled(view.source_camera, factor);
  if (undistort && view.camera.model == CameraModel::kOpenCv) {
    view.camera.model = CameraModel::kPinhole;
    view.camera.distortion = {};
  }
}

/// The mask has the photo's shape, not necessarily its size.
void check_mask(const View& view) {
  const io::ImageSize size = io::image_size(view.mask_path);
  const Camera& photo = view.source_camera;
  const double expected_height = static_cast<double>(size.width) * photo.height / photo.width;
  if (std::abs(expected_height - size.height) > std::max(2.0, 0.02 * size.height)) {
    throw DataError(fmt::format(
        "The mask {} has {} x {} pixels but its photo {} x {}, which is another shape: make it of "
        "the photo that it belongs to",
        view.mask_path.string(), size.width, size.height, photo.width, photo.height));
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

/// A folder of photos and the factor by which they are smaller than the model's cameras.
struct PhotoFolder {
  fs::path path;
  double factor = 1.0;
};

PhotoFolder choose_photo_folder(const fs::path& root, double downscale) {
  const auto reduced = [&](int factor) { return root / fmt::format("images_{}", factor); };
  if (downscale > 1 && downscale <= 1024 && downscale == std::floor(downscale) &&
      is_folder(reduced(static_cast<int>(downscale)))) {
    return {reduced(static_cast<int>(downscale)), downscale};
  }
  if (is_folder(root / "images")) return {root / "images", 1.0};
  std::optional<PhotoFolder> chosen;
  for (const int factor : {2, 4, 8}) {
    // The most reduced copy that is large enough, or else the largest copy.
    if (is_folder(reduced(factor)) && (!chosen || factor <= downscale)) {
      chosen = PhotoFolder{reduced(factor), static_cast<double>(factor)};
    }
  }
  if (!chosen) {
    // Photos beside the model, for example when their names in the model include a folder.
    return {root, 1.0};
  }
  if (chosen->factor > downscale) {
    spdlog::info("{} has no folder images: {} is used at its own size, as with --downscale {}",
                 root.string(), chosen->path.filename().string(), chosen->factor);
  } else {
    spdlog::info("{} has no folder images: {} is used", root.string(),
                 chosen->path.filename().string());
  }
  return *chosen;
}

/// The photo of a COLMAP image: by its whole name, by its last part, or with another extension
/// (reduced copies are often stored in another format).
std::optional<fs::path> find_photo(const fs::path& folder, const fs::path& name) {
  for (const fs::path& candidate : {name, name.filename()}) {
    if (is_file(folder / candidate)) return folder / candidate;
    fs::path stem = candidate;
    stem.replace_extension();
    if (auto found = io::find_image(folder, stem)) return found;
  }
  return std::nullopt;
}

Dataset load_colmap(const fs::path& root,
                    const fs::path& model_folder,
                    const DatasetOptions& options) {
  io::ColmapModel model = io::read_colmap_model(model_folder);
  Dataset dataset;
  dataset.kind = DatasetKind::kColmap;
  dataset.points = std::move(model.points);
  const PhotoFolder folder = choose_photo_folder(root, options.downscale);
  const double rest = std::max(1.0, options.downscale / folder.factor);
  for (const io::ColmapImage& image : model.images) {
    View view;
    const auto photo = find_photo(folder.path, image.name);
    if (!photo) {
      throw DataError(fmt::format("The image '{}' of the COLMAP model {} does not exist in {}",
                                  image.name, model_folder.string(), folder.path.string()));
    }
    view.image_path = *photo;
    view.mask_path = find_mask(root, image.name);
    view.points = image.points;
    Camera nominal = model.cameras.at(image.camera_id);
    nominal.name = io::inner_name(image.name);
    nominal.rotation = image.rotation;
    nominal.translation = image.translation;
    set_cameras(view, nominal, io::image_size(view.image_path), rest, options.undistort);
    dataset.views.push_back(std::move(view));
  }
  sort_by_name(dataset.views);
  mark_every(dataset.views, options.test_every);
  set_origin(dataset, model.positions, options);
  return dataset;
}

/// The views of a transforms file, in its order.
std::vector<View> transforms_views(const io::TransformsFile& file, const DatasetOptions& options) {
  const fs::path folder = file.path.parent_path();
  std::vector<View> views;
  for (std::size_t i = 0; i < file.frames.size(); ++i) {
    const io::TransformsFrame& frame = file.frames[i];
    if (frame.file_path.empty()) {
      throw DataError(fmt::format("{}: frame {} has no file_path", file.path.string(), i));
    }
    const auto photo = io::find_image(folder, frame.file_path);
    if (!photo) {
      throw DataError(fmt::format("{}: the image '{}' of frame {} does not exist",
                                  file.path.string(), frame.file_path, i));
    }
    View view;
    view.image_path = *photo;
    fs::path name = frame.file_path;
    if (!io::has_image_extension(name)) name += photo->extension();
    if (!frame.mask_path.empty()) {
      view.mask_path = folder / frame.mask_path;
      if (!is_file(view.mask_path)) {
        throw DataError(fmt::format("{}: the mask '{}' of frame {} does not exist",
                                    file.path.string(), frame.mask_path, i));
      }
    } else {
      // Names may repeat in several folders (train/r_0, test/r_0).
      view.mask_path = find_mask(folder, io::inner_name(name));
      if (view.mask_path.empty()) view.mask_path = find_mask(folder, photo->filename());
    }
    if (!frame.depth_path.empty()) {
      view.depth_path = folder / frame.depth_path;
      if (!is_file(view.depth_path)) {
        throw DataError(fmt::format("{}: the depth map '{}' of frame {} does not exist",
                                    file.path.string(), frame.depth_path, i));
      }
    }
    const io::ImageSize size = io::image_size(*photo);
    Camera nominal = io::frame_camera(file, i, frame.width.value_or(size.width),
                                      frame.height.value_or(size.height));
    nominal.name = io::inner_name(name);
    set_cameras(view, nominal, size, options.downscale, options.undistort);
    views.push_back(std::move(view));
  }
  return views;
}

Dataset load_blender(const fs::path& root, const DatasetOptions& options) {
  Dataset dataset;
  dataset.kind = DatasetKind::kBlender;
  dataset.views = transforms_views(io::read_transforms(root / "transforms_train.json"), options);
  sort_by_name(dataset.views);
  std::optional<fs::path> held_out;
  for (const char* name : {"transforms_val.json", "transforms_test.json"}) {
    if (is_file(root / name)) held_out = root / name;
  }
  if (!held_out) {
    mark_every(dataset.views, options.test_every);
    set_origin(dataset, {}, options);
    return dataset;
  }
  std::vector<View> test = transforms_views(io::read_transforms(*held_out), options);
  sort_by_name(test);
  for (View& view : test) {
    view.test = true;
    dataset.views.push_back(std::move(view));
  }
  set_origin(dataset, {}, options);
  return dataset;
}

Dataset load_nerfstudio(const fs::path& root, const DatasetOptions& options) {
  const io::TransformsFile file = io::read_transforms(root / "transforms.json");
  Dataset dataset;
  dataset.kind = DatasetKind::kNerfstudio;
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
    sort_by_name(dataset.views);
  }
  if (!file.ply_file_path.empty()) dataset.points = io::read_ply_points(root / file.ply_file_path);
  const std::vector<double> points(dataset.points.positions.begin(),
                                   dataset.points.positions.end());
  set_origin(dataset, points, options);
  return dataset;
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

Dataset load_any(const fs::path& root, const DatasetOptions& options) {
  if (const auto model = io::find_colmap_model(root)) return load_colmap(root, *model, options);
  if (is_file(root / "transforms.json")) return load_nerfstudio(root, options);
  if (is_file(root / "transforms_train.json")) return load_blender(root, options);
  throw DataError(
      fmt::format("{} is no data set: it has neither a COLMAP model (sparse/0) nor transforms.json "
                  "nor transforms_train.json",
                  root.string()));
}

}  // namespace

std::vector<std::size_t> Dataset::indices(Split split) const {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (split == Split::kAll || views[i].test == (split == Split::kTest)) out.push_back(i);
  }
  return out;
}

Dataset load_dataset(const fs::path& root, const DatasetOptions& options) {
  if (!(options.downscale >= 1 && options.downscale <= 1024)) {
    throw UsageError(fmt::format("The downscale factor is {}: it must lie between 1 and 1024",
                                 options.downscale));
  }
  if (options.test_every < 0) {
    throw UsageError(
        fmt::format("The test interval is {}: it must be 0 or more", options.test_every));
  }
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
  dataset.alpha_is_background = shows_cut_outs(dataset, options.alpha);
  const auto has_mask = [](const View& view) { return !view.mask_path.empty(); };
  const auto masked = std::count_if(dataset.views.begin(), dataset.views.end(), has_mask);
  if (masked > 0) {
    for (const View& view : dataset.views) {
      if (has_mask(view)) check_mask(view);
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
