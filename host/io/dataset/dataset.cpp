// SPDX-License-Identifier: Apache-2.0
#include "raysplats/dataset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/data_origin.hpp"
#include "io/dataset/dataset_formats.hpp"
#include "io/dataset/dataset_photos.hpp"
#include "io/dataset/photo_folder.hpp"
#include "io/dataset/photo_views.hpp"
#include "io/dataset/sized_dataset.hpp"
#include "io/dataset/test_list.hpp"
#include "io/photo/repeated_photos.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

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

bool is_transforms(const fs::path& path) {
  return path.filename().string().starts_with("transforms") && path.extension() == ".json" &&
         is_file(path);
}

/// What the files of a data set say of its views and points; no photo is decoded. `path` may name
/// one of the files in the folder `root`.
Dataset read_views(const fs::path& path, const fs::path& root, const DatasetOptions& options) {
  Dataset dataset = path == root ? io::read_data_folder(root, options)
                                 : io::read_named_transforms(root / path.filename(), options);
  dataset.root = root;
  if (options.test_list) {
    io::hold_out(dataset, *options.test_list);
    io::sort_by_name(dataset.views);
  }
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
  check_areas(options.ignore_areas);
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
  io::look_at_photos(dataset, options);
  dataset.read_as = options;
  return dataset;
}

}  // namespace raysplats
