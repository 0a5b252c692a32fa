// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/dataset_photos.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <vector>

#include "io/dataset/photo_views.hpp"
#include "io/image/color_profiles.hpp"
#include "io/image/image_header.hpp"
#include "io/photo/photo_border.hpp"
#include "io/photo/photo_mask.hpp"
#include "io/photo/photo_transparency.hpp"
#include "raysplats/error.hpp"
#include "util/number_text.hpp"

namespace raysplats::io {
namespace {

/// Whether what is transparent in the photos is background.
bool shows_cut_outs(const Dataset& dataset, AlphaUse use) {
  if (use != AlphaUse::kAuto) return use == AlphaUse::kCutout;
  const auto [kind, count, exact] = transparency(dataset.views);
  if (kind == Transparency::kNone && count > 0) {
    spdlog::warn(
        "{}{} of {} photos have something transparent: it does not count there (alpha = cutout "
        "makes it background)",
        exact ? "" : "about ", count, dataset.views.size());
  }
  // Rendered photos have no lens that leaves a border, and nobody cuts anything out of them.
  if (dataset.kind == DatasetKind::kBlender) return kind != Transparency::kNone;
  if (kind == Transparency::kBorder) {
    spdlog::info(
        "All photos are transparent in the same places, as at the edge of a lens: these do not "
        "count (alpha = cutout makes them background)");
  }
  if (kind == Transparency::kHoles) {
    spdlog::info(
        "The photos have holes: what is transparent in them lies around no body and does not count "
        "(alpha = cutout makes it background)");
  }
  if (kind == Transparency::kCutOut) {
    spdlog::info(
        "The photos are cut out: what is transparent in them is background (with alpha = ignore "
        "it does not count)");
  }
  return kind == Transparency::kCutOut;
}

void leave_out_borders(Dataset& dataset) {
  find_borders(dataset.views);
  const auto has_border = [](const View& view) { return view.border != nullptr; };
  const auto first = std::find_if(dataset.views.begin(), dataset.views.end(), has_border);
  if (first == dataset.views.end()) return;
  // Of bars; a vertical video between them has more.
  constexpr double kUsualShare = 0.4;
  const double share = hidden_share(*first->border);
  spdlog::log(
      share > kUsualShare ? spdlog::level::warn : spdlog::level::info,
      "photos of the size of {} have the same black border, of {:.0f} % of their pixels, as the "
      "bars of a video, around a lens's circle or beyond a lamp's light: in {} of {} photos it "
      "does not count (with borders = keep it is a part of the scene)",
      first->image_path.string(), std::max(1.0, 100.0 * share),
      std::count_if(dataset.views.begin(), dataset.views.end(), has_border), dataset.views.size());
}

void leave_out_areas(Dataset& dataset, const std::vector<PhotoArea>& areas) {
  if (areas.empty()) return;
  if (dataset.alpha_is_background) {
    throw UsageError(
        "The option 'ignore-areas' is for photos that show a scene all over, but these are cut "
        "out: make what is in the areas transparent, or leave it out by masks");
  }
  spdlog::info("{} of all photos do not count (ignore-areas)", counted(areas.size(), "area"));
  for (View& view : dataset.views) view.ignored = areas;
}

/// Whether there may be pixels of a view of which its photo tells nothing: what is transparent, or
/// what the lens does not reach.
bool may_have_gaps(const View& view) {
  const CameraModel lens = view.source_camera.model;
  return lens == CameraModel::kOpenCv || lens == CameraModel::kFisheye ||
         lens == CameraModel::kPhotoLens || may_be_transparent(view.image_path);
}

}  // namespace

void check_areas(std::span<const PhotoArea> areas) {
  for (const PhotoArea& area : areas) {
    if (area.left >= 0 && area.left < area.right && area.right <= 1 && area.top >= 0 &&
        area.top < area.bottom && area.bottom <= 1)
      continue;
    throw UsageError(fmt::format(
        "The area {}, {}, {}, {} of photos is no box: left, top, right and bottom are shares of "
        "width and height from 0 to 1, right above left and bottom above top",
        area.left, area.top, area.right, area.bottom));
  }
}

std::string text_of(std::span<const PhotoArea> areas) {
  std::vector<double> numbers;
  for (const PhotoArea& area : areas)
    numbers.insert(numbers.end(), {area.left, area.top, area.right, area.bottom});
  return fmt::format("{}", fmt::join(numbers, ", "));
}

void look_at_photos(Dataset& dataset, const DatasetOptions& options) {
  warn_of_color_profiles(dataset.views);
  warn_of_folding_lenses(dataset.views);
  warn_of_principal_points(dataset.views);
  dataset.alpha_is_background = shows_cut_outs(dataset, options.alpha);
  const auto has_mask = [](const View& view) { return !view.mask_path.empty(); };
  const auto masked = std::count_if(dataset.views.begin(), dataset.views.end(), has_mask);
  warn_of_masks(dataset.views, dataset.root);
  if (masked > 0) {
    for (const View& view : dataset.views) {
      if (has_mask(view)) check_mask(view);
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
  leave_out_areas(dataset, options.ignore_areas);
}

}  // namespace raysplats::io
