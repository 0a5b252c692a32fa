// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/image.hpp"
#include "raysplats/lpips.hpp"

namespace raysplats {

class Communicator;

/// Measures of one view, or their means over views.
struct EvaluationMetrics {
  std::string name;  ///< of the photo; "" of a mean
  double psnr = 0;   ///< decibels, over the pixels that are not masked out; at most 100
  double ssim = 0;   ///< at most 1, over the same pixels
  /// psnr after the affine colour (3 x 4) that brings the render closest to the photo: what is
  /// left when exposure and white balance do not count.
  double psnr_corrected = 0;
  /// psnr where the render is shifted in its plane to where it comes closest to the photo: much
  /// more where poses are inexact, next to nothing elsewhere.
  double psnr_shifted = 0;
  /// With EvaluationOptions::align, as psnr where the camera was turned and shifted to where its
  /// picture comes closest to the photo: what is left when errors of poses do not count. With
  /// EvaluationOptions::align_colors as psnr_corrected there.
  std::optional<double> psnr_aligned;
  std::optional<double> psnr_all;  ///< over all pixels, when some are masked out
  /// When a network was given: of whole pictures, which are equal where pixels are masked out.
  std::optional<double> lpips;
  std::string picture;             ///< its file in the output folder; empty when none was written
  std::array<double, 3> center{};  ///< of the camera, from Dataset::origin
  std::array<double, 2> shift{};   ///< that of psnr_shifted: pixels to the right and down
  /// How sharp the photo is, to compare with others of the scene: the mean square of the Laplacian
  /// of its brightness.
  double sharpness = 0;
  /// The same of the photo reduced to some 24 pixels of its longer side: whether there is much to
  /// be sharp about.
  double coarse_sharpness = 0;
};

/// The measures of a comparison.
struct EvaluationReport {
  EvaluationMetrics mean;                 ///< over the views
  std::vector<EvaluationMetrics> images;  ///< of each view, in the order of the data set

  /// One line per image and the mean, aligned.
  std::string table() const;
  /// {"psnr", "ssim", "psnr_corrected", "psnr_shifted", "psnr_aligned" (if asked for), "psnr_all"
  /// (if some pixels are masked out), "lpips" (if measured), "images": [{"name", "psnr", "ssim",
  /// ..., "center", "shift", "sharpness", "coarse_sharpness", "picture" (if written)}]}.
  std::string json() const;
};

/// What evaluate() does beside comparing all views.
struct EvaluationOptions {
  std::size_t max_views = 0;  ///< 0 = all; else so many, spread evenly over the split
  /// Side-by-side pictures at most; all when unset. Fewer than there are views show the worst, the
  /// median and the best by PSNR, then the first ones, and are traced a second time. Where that is
  /// stopped, EvaluationMetrics::picture names none.
  std::optional<std::size_t> max_pictures;
  Lpips* lpips = nullptr;  ///< for EvaluationMetrics::lpips; not owned
  /// Measure psnr_aligned too, which takes 10 to 60 pictures of each view. Not with `together`.
  bool align = false;
  /// With `align`: pictures are compared in the colours that come closest to the photo, so that
  /// psnr_aligned is as psnr_corrected where the camera was turned and shifted.
  bool align_colors = false;
  /// Called with the number of finished views; false stops.
  std::function<bool(std::size_t finished)> done = {};
  /// Of the library itself; its type is not installed. With it every rank calls evaluate() and
  /// compares its share of the views; all get the whole report.
  Communicator* ranks = nullptr;
  /// With `ranks`: every rank renders every view, and what `render` yields is a picture for the
  /// rank that leads alone, which compares it. It is empty for all or none.
  bool together = false;
  /// The photo of a view, by its number in the data set, for callers that keep some;
  /// load_view_picture() when unset.
  std::function<std::shared_ptr<const ViewPicture>(std::size_t view)> photo = {};
};

/// The names of the pictures that evaluate() writes of all views of a split, without extension.
std::vector<std::string> evaluated_names(const Dataset& dataset, Split split);

/// Compares renders with the photos of a split. `render` yields RGB (further channels are ignored)
/// of the camera's size, `background` blended in, or an empty image to stop early; it is clamped to
/// [0, 1] and compared in floating point. The photo is composited over `background` when the data
/// set's alpha is background; else alpha is a mask, and where it is 0 the photo takes the place of
/// the render. With an output folder the photo | render | error of views goes to NAME.png there,
/// and the report to metrics.json, unless it was stopped before the first comparison. Throws
/// UsageError when the split has no views, or a render or photo another size than its camera or
/// more or fewer numbers than its size says, DataError when masks leave no pixel of any view;
/// single views without one are left out with a warning.
EvaluationReport evaluate(const std::function<Image(const Camera&)>& render,
                          const Dataset& dataset,
                          Split split,
                          const std::array<float, 3>& background,
                          const std::filesystem::path& output = {},
                          const EvaluationOptions& options = {});

}  // namespace raysplats
