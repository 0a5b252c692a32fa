// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace raysplats {

/// Mean over the test views at one iteration.
struct EvaluationRow {
  std::int64_t iteration = 0;          ///< completed when it was made
  double training_seconds = 0;         ///< until then, as TrainSummary::training_seconds
  double psnr = 0;                     ///< decibels
  double ssim = 0;                     ///< at most 1
  std::size_t views = 0;               ///< that were compared
  std::size_t gaussians = 0;           ///< of the model
  double psnr_corrected = 0;           ///< as EvaluationMetrics::psnr_corrected
  std::optional<double> psnr_all;      ///< as EvaluationMetrics::psnr_all
  std::optional<double> psnr_aligned;  ///< as EvaluationMetrics::psnr_aligned
};

}  // namespace raysplats
