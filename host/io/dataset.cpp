// SPDX-License-Identifier: Apache-2.0
#include "raysplats/dataset.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "io/colmap_model.hpp"
#include "io/colmap_views.hpp"
#include "io/color_profiles.hpp"
#include "io/data_origin.hpp"
#include "io/dataset_advice.hpp"
#include "io/find_image.hpp"
#include "io/frame_lists.hpp"
#include "io/image_header.hpp"
#include "io/llff.hpp"
#include "io/photo_border.hpp"
#include "io/photo_folder.hpp"
#include "io/photo_mask.hpp"
#include "io/photo_transparency.hpp"
#include "io/photo_views.hpp"
#include "io/ply_points.hpp"
#include "io/polycam.hpp"
#include "io/repeated_photos.hpp"
#include "io/sized_dataset.hpp"
#include "io/transforms.hpp"
#include "io/transforms_views.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

void mark_every(Dataset& dataset, int test_every) {
  std::vector<View>& views = dataset.views;
  if (test_every <= 0) return;
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

/// Gives the data set the points of a PLY; returns their positions as precise as they are there.
std::vector<double> take_points(Dataset& dataset, const fs::path& path) {
  io::PlyPoints points = io::read_ply_points(path);
  dataset.points = std::move(points.cloud);
  return std::move(points.positions);
}

Dataset load_colmap(const fs::path& root,
                    const fs::path& model_folder,
                    const DatasetOptions& options) {
  io::ColmapModel model = io::read_colmap_model(model_folder);
  Dataset dataset;
  dataset.kind = DatasetKind::kColmap;
  dataset.points = std::move(model.points);
  dataset.views = io::colmap_views(model, model_folder, root, options);
  sort_by_name(dataset.views);
  mark_every(dataset, options.test_every);
  set_origin(dataset, model.positions, options);
  return dataset;
}

/// The file of the held-out views of a Blender data set; nothing where it has none. That of a part
/// that was not copied may be left over.
std::optional<io::TransformsFile> held_out_file(const fs::path& root) {
  for (const char* name : {"transforms_test.json", "transforms_val.json"}) {
    const fs::path path = root / name;
    if (!is_file(path)) continue;
    io::TransformsFile file = io::read_transforms(path);
    if (file.frames.empty()) {
      spdlog::warn("{} has no frames: it is not used", path.string());
      continue;
    }
    if (io::has_photos(file)) return file;
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
  io::TransformsFile train = io::read_transforms(root / "transforms_train.json");
  std::optional<io::TransformsFile> held_out = held_out_file(root);
  io::MaskFinder masks(root);
  io::add_photos(train, masks);
  if (held_out) io::add_photos(*held_out, masks);
  dataset.views = io::transforms_views(train, options, masks);
  sort_by_name(dataset.views);
  if (held_out) {
    std::vector<View> test = io::transforms_views(*held_out, options, masks);
    io::require_photos_of_their_own({&train, &*held_out});
    sort_by_name(test);
    for (View& view : test) {
      view.test = true;
      dataset.views.push_back(std::move(view));
    }
  } else {
    io::require_photos_of_their_own({&train});
    mark_every(dataset, options.test_every);
  }
  set_origin(dataset, points, options);
  return dataset;
}

/// The points that a file of cameras names, also where another machine has them elsewhere; nothing,
/// with a warning, where they are not there.
std::optional<fs::path> points_of(const io::TransformsFile& file) {
  if (file.ply_file_path.empty()) return std::nullopt;
  const fs::path folder = file.path.parent_path();
  fs::path path = io::find_beside(folder, file.ply_file_path, 1);
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
std::vector<View> views_of(io::TransformsFile& file, const DatasetOptions& options) {
  io::MaskFinder masks(file.path.parent_path());
  io::add_photos(file, masks);
  std::vector<View> views = io::transforms_views(file, options, masks);
  io::require_photos_of_their_own({&file});
  return views;
}

Dataset load_nerfstudio(const fs::path& path, const DatasetOptions& options) {
  io::TransformsFile file = io::read_transforms(path);
  Dataset dataset;
  dataset.kind = DatasetKind::kNerfstudio;
  const std::set<std::string> names = io::frame_names(file);
  dataset.views = views_of(file, options);
  const bool divided = io::divide_by_lists(file, names, dataset.views);
  sort_by_name(dataset.views);
  if (!divided) mark_every(dataset, options.test_every);
  std::vector<double> points;
  if (const auto path = points_of(file)) points = take_points(dataset, *path);
  set_origin(dataset, points, options);
  return dataset;
}

/// A data set of frames that are all there is.
Dataset load_frames(DatasetKind kind, io::TransformsFile file, const DatasetOptions& options) {
  Dataset dataset;
  dataset.kind = kind;
  dataset.views = views_of(file, options);
  sort_by_name(dataset.views);
  mark_every(dataset, options.test_every);
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
  const auto [kind, count, exact] = io::transparency(dataset.views);
  if (kind == io::Transparency::kNone && count > 0) {
    spdlog::warn(
        "{}{} of {} photos have something transparent: it does not count there (alpha = cutout "
        "makes it background)",
        exact ? "" : "about ", count, dataset.views.size());
  }
  // Rendered photos have no lens that leaves a border, and nobody cuts anything out of them.
  if (dataset.kind == DatasetKind::kBlender) return kind != io::Transparency::kNone;
  if (kind == io::Transparency::kBorder) {
    spdlog::info(
        "All photos are transparent in the same places, as at the edge of a lens: these do not "
        "count (alpha = cutout makes them background)");
  }
  if (kind == io::Transparency::kHoles) {
    spdlog::info(
        "The photos have holes: what is transparent in them lies around no body and does not count "
        "(alpha = cutout makes it background)");
  }
  if (kind == io::Transparency::kCutOut) {
    spdlog::info(
        "The photos are cut out: what is transparent in them is background (with alpha = ignore "
        "it does not count)");
  }
  return kind == io::Transparency::kCutOut;
}

void leave_out_borders(Dataset& dataset) {
  io::find_borders(dataset.views);
  const auto has_border = [](const View& view) { return view.border != nullptr; };
  const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), has_border);
  if (first == dataset.views.end()) return;
  // Of bars; a vertical video between them has more.
  constexpr double kUsualShare = 0.4;
  const double share = io::hidden_share(*first->border);
  spdlog::log(
      share > kUsualShare ? spdlog::level::warn : spdlog::level::info,
      "photos of the size of {} have the same black border, of {:.0f} % of their pixels, as the "
      "bars of a video, around a lens's circle or beyond a lamp's light: in {} of {} photos it "
      "does not count (with borders = keep it is a part of the scene)",
      first->image_path.string(), std::max(1.0, 100.0 * share),
      std::count_if(dataset.views.begin(), dataset.views.end(), has_border), dataset.views.size());
}

/// What nerfstudio makes of a capture has COLMAP's model in a folder of its own. Its file says more
/// (masks, depth maps, lists), and where it has points there is nothing that the model has more.
bool goes_before(const fs::path& transforms, const fs::path& root, const fs::path& model) {
  if (model.lexically_relative(root / "colmap").begin()->string() == "..") return false;
  const std::string points = io::read_transforms(transforms).ply_file_path;
  return !points.empty() && is_file(io::find_beside(root, points, 1));
}

Dataset load_any(const fs::path& root, const DatasetOptions& options) {
  const fs::path transforms = root / "transforms.json";
  if (const auto model = io::find_colmap_model(root)) {
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
  if (is_file(root / io::kLlffPoses)) return load_llff(root, options);
  if (const auto polycam = io::find_polycam(root))
    return load_frames(DatasetKind::kPolycam, io::read_polycam(*polycam, root), options);
  throw DataError(
      fmt::format("{} is no data set: it has neither a COLMAP model (sparse/0) nor transforms.json "
                  "nor transforms_train.json nor poses_bounds.npy (LLFF) nor keyframes/cameras "
                  "(Polycam){}",
                  root.string(), io::advice_for(root)));
}

bool is_transforms(const fs::path& path) {
  return path.filename().string().starts_with("transforms") && path.extension() == ".json" &&
         is_file(path);
}

/// The data set of a transforms file that was named, whatever else lies beside it: those of Blender
/// belong together, any other is the only one that is read.
Dataset load_named(const fs::path& file, const DatasetOptions& options) {
  const fs::path root = file.parent_path(), name = file.filename();
  const bool is_part = name == "transforms_train.json" || name == "transforms_val.json" ||
                       name == "transforms_test.json";
  if (is_part && is_file(root / "transforms_train.json")) return load_blender(root, options);
  return load_nerfstudio(file, options);
}

void check_downscale(double factor) {
  if (factor >= 1 && factor <= 1024) return;
  throw UsageError(
      fmt::format("The downscale factor is {}: it must lie between 1 and 1024", factor));
}

void check_origin(const std::optional<std::array<double, 3>>& origin) {
  // NaN is not near.
  const auto near = [](double value) { return std::abs(value) <= io::kFarthestOrigin; };
  if (!origin || std::all_of(origin->begin(), origin->end(), near)) return;
  throw UsageError(fmt::format(
      "The origin is {}, {}, {}: each of its numbers must lie between -{:g} and {:g}", (*origin)[0],
      (*origin)[1], (*origin)[2], io::kFarthestOrigin, io::kFarthestOrigin));
}

/// What the files of a data set say of its views and points; no photo is decoded. `path` may name
/// one of the files in the folder `root`.
Dataset read_views(const fs::path& path, const fs::path& root, const DatasetOptions& options) {
  Dataset dataset =
      path == root ? load_any(root, options) : load_named(root / path.filename(), options);
  dataset.root = root;
  if (dataset.views.empty()) {
    throw DataError(
        fmt::format("The data set {} has no views: there is nothing to train on", root.string()));
  }
  io::settle_repeated_photos(dataset.views);
  return dataset;
}

/// Reduced copies of photos that a data set may have at a size.
std::optional<io::PhotoFolder> copies_at(const Dataset& dataset, double downscale) {
  if (dataset.kind != DatasetKind::kColmap && dataset.kind != DatasetKind::kLlff)
    return std::nullopt;
  return io::reduced_copies(dataset.root, downscale);
}

/// Whether views have the same photos at either size.
bool shares_photos(const Dataset& dataset, double one, double other) {
  return !copies_at(dataset, one) && !copies_at(dataset, other);
}

/// By what the photos of a data set that was read at a size are divided in their files.
double factor_in_files(const Dataset& dataset, double downscale) {
  const std::optional<io::PhotoFolder> copies = copies_at(dataset, downscale);
  if (!copies) return 1;
  // Another folder is used where these have not the photos.
  const fs::path photo = dataset.views.front().image_path.lexically_normal().lexically_relative(
      copies->path.lexically_normal());
  return photo.string().starts_with("..") ? 1 : copies->factor;
}

/// Whether there may be pixels of a view of which its photo tells nothing: what is transparent, or
/// what the lens does not reach.
bool may_have_gaps(const View& view) {
  const CameraModel lens = view.source_camera.model;
  return lens == CameraModel::kOpenCv || lens == CameraModel::kFisheye ||
         lens == CameraModel::kPhotoLens || io::may_be_transparent(view.image_path);
}

/// Finds what photos that are decoded tell of all of them, and warns of what they do not say.
void look_at_photos(Dataset& dataset, const DatasetOptions& options) {
  io::warn_of_color_profiles(dataset.views);
  io::warn_of_folding_lenses(dataset.views);
  io::warn_of_principal_points(dataset.views);
  dataset.alpha_is_background = shows_cut_outs(dataset, options.alpha);
  const auto has_mask = [](const View& view) { return !view.mask_path.empty(); };
  const auto masked = std::count_if(dataset.views.begin(), dataset.views.end(), has_mask);
  io::warn_of_masks(dataset.views, dataset.root);
  if (masked > 0) {
    for (const View& view : dataset.views) {
      if (has_mask(view)) io::check_mask(view);
    }
    const bool ignores = options.masks == MaskUse::kIgnore;
    const bool cut_out = dataset.alpha_is_background;
    if (!ignores) dataset.alpha_is_background = true;
    for (View& view : dataset.views) {
      view.mask_apart = ignores ? cut_out && has_mask(view) : !cut_out && may_have_gaps(view);
      view.mask_cuts = !ignores && has_mask(view);
    }
    const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), has_mask);
    spdlog::info("{} of {} photos have a mask, as {}: what is black there {}", masked,
                 dataset.views.size(), first->mask_path.string(),
                 ignores ? "does not count" : "is background");
  }
  if (options.borders == BorderUse::kAuto && !dataset.alpha_is_background)
    leave_out_borders(dataset);
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
  return io::load_sized_dataset(path, options, {});
}

Dataset io::load_sized_dataset(const fs::path& path,
                               DatasetOptions options,
                               const DownscaleChoice& choose) {
  if (options.downscale == 0) options.downscale = 1;
  check_downscale(options.downscale);
  if (options.test_every < 0) {
    throw UsageError(
        fmt::format("The test interval is {}: it must be 0 or more", options.test_every));
  }
  check_origin(options.origin);
  const fs::path root = is_transforms(path) ? fs::absolute(path).parent_path() : path;
  if (!is_folder(root)) {
    throw DataError(fmt::format("The data set {} {}: give the folder of a data set", root.string(),
                                is_there(root) ? "is a file" : "does not exist"));
  }
  Dataset dataset = read_views(path, root, options);
  const double read = options.downscale;
  if (choose) options.downscale = choose(dataset, factor_in_files(dataset, read));
  if (options.downscale != read) {
    check_downscale(options.downscale);
    if (shares_photos(dataset, read, options.downscale)) {
      for (View& view : dataset.views)
        view.camera = io::picture_camera(view.source_camera, options.downscale, options.undistort);
    } else {
      dataset = read_views(path, root, options);
    }
  }
  look_at_photos(dataset, options);
  dataset.read_as = options;
  return dataset;
}

}  // namespace raysplats
