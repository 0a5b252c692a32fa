// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace raysplats {

/// Mean over the test views at one iteration.
struct EvaluationRow {
  std::int64_t iteration = 0;
  double training_seconds = 0;
  double psnr = 0;  ///< decibels
  double ssim = 0;
  std::size_t views = 0;
  std::size_t gaussians = 0;
  double psnr_corrected = 0;           ///< as EvaluationMetrics::psnr_corrected
  std::optional<double> psnr_all;      ///< as EvaluationMetrics::psnr_all
  std::optional<double> psnr_aligned;  ///< as EvaluationMetrics::psnr_aligned
};

}  // namespace raysplats
