// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/dataset_formats.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/dataset/colmap_model.hpp"
#include "io/dataset/colmap_views.hpp"
#include "io/dataset/data_origin.hpp"
#include "io/dataset/dataset_advice.hpp"
#include "io/dataset/find_image.hpp"
#include "io/dataset/frame_lists.hpp"
#include "io/dataset/llff.hpp"
#include "io/dataset/photo_folder.hpp"
#include "io/dataset/photo_views.hpp"
#include "io/dataset/ply_points.hpp"
#include "io/dataset/polycam.hpp"
#include "io/dataset/transforms.hpp"
#include "io/dataset/transforms_views.hpp"
#include "io/photo/photo_mask.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

void mark_every(Dataset& dataset, const DatasetOptions& options) {
  std::vector<View>& views = dataset.views;
  const int test_every = options.test_every;
  if (test_every <= 0 || options.test_list) return;
  if (views.size() == 1 && test_every > 1) return;  // a photo alone is trained on
  const auto step = static_cast<std::size_t>(test_every);
  for (std::size_t i = 0; i < views.size(); i += step) views[i].test = true;
  dataset.test_every = test_every;
}

/// Counts all positions from the origin that the options or the scene say; `points`: of
/// dataset.points, as precise as in their file.
void set_origin(Dataset& dataset, std::span<const double> points, const DatasetOptions& options) {
  glm::dvec3 origin;
  if (options.origin) {
    const std::array<double, 3>& o = *options.origin;
    origin = {o[0], o[1], o[2]};
  } else {
    origin = fitting_origin(dataset.views, points);
  }
  if (origin == glm::dvec3(0.0)) return;
  spdlog::info(
      "positions count from {}, {}, {}: the scene lies far from the origin of its files, where "
      "single precision would blur it",
      origin.x, origin.y, origin.z);
  dataset.origin = {origin.x, origin.y, origin.z};
  for (View& view : dataset.views) {
    move_origin(view.camera, origin);
    move_origin(view.source_camera, origin);
  }
  for (std::size_t i = 0; i < points.size(); ++i) {
    dataset.points.positions[i] = static_cast<float>(points[i] - origin[static_cast<int>(i % 3)]);
  }
}

/// Gives the data set the points of a PLY; returns their positions as precise as they are there.
std::vector<double> take_points(Dataset& dataset, const fs::path& path) {
  PlyPoints points = read_ply_points(path);
  dataset.points = std::move(points.cloud);
  return std::move(points.positions);
}

Dataset load_colmap(const fs::path& root,
                    const fs::path& model_folder,
                    const DatasetOptions& options) {
  ColmapModel model = read_colmap_model(model_folder);
  Dataset dataset;
  dataset.kind = DatasetKind::kColmap;
  dataset.points = std::move(model.points);
  dataset.views = colmap_views(model, model_folder, root, options);
  const bool divided =
      divide_by_lists(model, model_folder, root, options.test_list.has_value(), dataset.views);
  sort_by_name(dataset.views);
  if (!divided) mark_every(dataset, options);
  set_origin(dataset, model.positions, options);
  return dataset;
}

/// The file of the held-out views of a Blender data set; nothing where it has none. That of a part
/// that was not copied may be left over.
std::optional<TransformsFile> held_out_file(const fs::path& root) {
  for (const char* name : {"transforms_test.json", "transforms_val.json"}) {
    const fs::path path = root / name;
    if (!is_file(path)) continue;
    TransformsFile file = read_transforms(path);
    if (file.frames.empty()) {
      spdlog::warn("{} has no frames: it is not used", path.string());
      continue;
    }
    if (has_photos(file)) return file;
    spdlog::warn("{}: none of its {} photos exist, '{}' the first: it is not used", path.string(),
                 file.frames.size(), file.frames.front().file_path);
  }
  return std::nullopt;
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
  TransformsFile train = read_transforms(root / "transforms_train.json");
  std::optional<TransformsFile> held_out = held_out_file(root);
  MaskFinder masks(root);
  add_photos(train, masks);
  if (held_out) add_photos(*held_out, masks);
  dataset.views = transforms_views(train, options, masks);
  sort_by_name(dataset.views);
  if (held_out) {
    std::vector<View> test = transforms_views(*held_out, options, masks);
    require_photos_of_their_own({&train, &*held_out});
    sort_by_name(test);
    for (View& view : test) {
      view.test = true;
      dataset.views.push_back(std::move(view));
    }
  } else {
    require_photos_of_their_own({&train});
    mark_every(dataset, options);
  }
  set_origin(dataset, points, options);
  return dataset;
}

/// The points that a file of cameras names, also where another machine has them elsewhere; nothing,
/// with a warning, where they are not there.
std::optional<fs::path> points_of(const TransformsFile& file) {
  if (file.ply_file_path.empty()) return std::nullopt;
  const fs::path folder = file.path.parent_path();
  fs::path path = find_beside(folder, file.ply_file_path, 1);
  if (!is_file(path)) {
    spdlog::warn(
        "{} names the points {}, which are not there: the data set has no points to start "
        "from",
        file.path.string(), file.ply_file_path);
    return std::nullopt;
  }
  if (path != folder / file.ply_file_path) {
    spdlog::info("{} is not where {} says: the points are those of {}", file.ply_file_path,
                 file.path.string(), path.string());
  }
  return path;
}

/// The views of a file that is the only one of its data set.
std::vector<View> views_of(TransformsFile& file, const DatasetOptions& options) {
  MaskFinder masks(file.path.parent_path());
  add_photos(file, masks);
  std::vector<View> views = transforms_views(file, options, masks);
  require_photos_of_their_own({&file});
  return views;
}

Dataset load_nerfstudio(const fs::path& path, const DatasetOptions& options) {
  TransformsFile file = read_transforms(path);
  Dataset dataset;
  dataset.kind = DatasetKind::kNerfstudio;
  const std::set<std::string> names = frame_names(file);
  dataset.views = views_of(file, options);
  const bool divided = divide_by_lists(file, names, options.test_list.has_value(), dataset.views);
  sort_by_name(dataset.views);
  if (!divided) mark_every(dataset, options);
  std::vector<double> points;
  if (const auto path = points_of(file)) points = take_points(dataset, *path);
  set_origin(dataset, points, options);
  return dataset;
}

/// A data set of frames that are all there is.
Dataset load_frames(DatasetKind kind, TransformsFile file, const DatasetOptions& options) {
  Dataset dataset;
  dataset.kind = kind;
  dataset.views = views_of(file, options);
  sort_by_name(dataset.views);
  mark_every(dataset, options);
  set_origin(dataset, {}, options);
  return dataset;
}

Dataset load_llff(const fs::path& root, DatasetOptions options) {
  const PhotoFolder folder = usual_photo_folder(root, options.downscale);
  options.downscale = std::max(1.0, options.downscale / folder.factor);
  return load_frames(DatasetKind::kLlff, read_llff(root / kLlffPoses, folder.path), options);
}

/// What nerfstudio makes of a capture has COLMAP's model in a folder of its own. Its file says more
/// (masks, depth maps, lists), and where it has points there is nothing that the model has more.
bool goes_before(const fs::path& transforms, const fs::path& root, const fs::path& model) {
  if (model.lexically_relative(root / "colmap").begin()->string() == "..") return false;
  const std::string points = read_transforms(transforms).ply_file_path;
  return !points.empty() && is_file(find_beside(root, points, 1));
}

}  // namespace

Dataset read_data_folder(const fs::path& root, const DatasetOptions& options) {
  const fs::path transforms = root / "transforms.json";
  if (const auto model = find_colmap_model(root)) {
    if (is_file(transforms)) {
      if (goes_before(transforms, root, *model)) {
        spdlog::info("{} is read, not the COLMAP model {}", transforms.string(), model->string());
        return load_nerfstudio(transforms, options);
      }
      spdlog::info("the COLMAP model {} is read, {} beside it is not", model->string(),
                   transforms.string());
    }
    return load_colmap(root, *model, options);
  }
  if (is_file(transforms)) return load_nerfstudio(transforms, options);
  if (is_file(root / "transforms_train.json")) return load_blender(root, options);
  if (is_file(root / kLlffPoses)) return load_llff(root, options);
  if (const auto polycam = find_polycam(root))
    return load_frames(DatasetKind::kPolycam, read_polycam(*polycam, root), options);
  throw DataError(
      fmt::format("{} is no data set: it has neither a COLMAP model (sparse/0) nor transforms.json "
                  "nor transforms_train.json nor poses_bounds.npy (LLFF) nor keyframes/cameras "
                  "(Polycam){}",
                  root.string(), advice_for(root)));
}

Dataset read_named_transforms(const fs::path& file, const DatasetOptions& options) {
  const fs::path root = file.parent_path(), name = file.filename();
  const bool is_part = name == "transforms_train.json" || name == "transforms_val.json" ||
                       name == "transforms_test.json";
  if (is_part && is_file(root / "transforms_train.json")) return load_blender(root, options);
  return load_nerfstudio(file, options);
}

}  // namespace raysplats::io
