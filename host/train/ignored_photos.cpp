// SPDX-License-Identifier: Apache-2.0
#include "train/ignored_photos.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <set>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/photo/photo_rows.hpp"
#include "raysplats/error.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

// Those that are black everywhere. Photos may share a mask.
std::set<fs::path> black_masks(const std::vector<View>& views) {
  std::set<fs::path> masks;
  for (const View& view : views) {
    if (!view.mask_path.empty() && !view.mask_cuts) masks.insert(view.mask_path);
  }
  const std::vector<fs::path> paths(masks.begin(), masks.end());
  std::vector<std::uint8_t> black(paths.size());
  in_parallel(paths.size(), [&](std::size_t i) {
    black[i] = io::is_black(io::read_raw_image(paths[i])) ? 1 : 0;
  });
  for (std::size_t i = 0; i < paths.size(); ++i) {
    if (black[i] == 0) masks.erase(paths[i]);
  }
  return masks;
}

}  // namespace

Dataset without_ignored_photos(Dataset dataset) {
  const std::set<fs::path> black = black_masks(dataset.views);
  if (black.empty()) return dataset;
  const std::size_t all = dataset.views.size();
  const std::size_t trained = dataset.indices(Split::kTrain).size();
  std::erase_if(dataset.views, [&](const View& view) {
    return !view.mask_cuts && black.contains(view.mask_path);
  });
  const std::size_t left_out = all - dataset.views.size();
  if (trained > 0 && dataset.indices(Split::kTrain).empty()) {
    throw DataError(fmt::format(
        "The masks of all {} training photos of {} are black everywhere, {} among them, and leave "
        "nothing to train on: give masks that are black where photos are to be ignored, or none",
        trained, dataset.root.string(), black.begin()->string()));
  }
  if (left_out > 0) {
    spdlog::warn(
        "{} of {} photos are left out: their masks, {} among them, are black everywhere and ignore "
        "all of them",
        left_out, all, black.begin()->string());
  }
  return dataset;
}

}  // namespace raysplats
