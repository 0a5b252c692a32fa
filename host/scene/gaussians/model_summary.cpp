// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/model_summary.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "scene/gaussians/activation.hpp"
#include "scene/statistics.hpp"

namespace raysplats {

ModelSummary summarize(const Gaussians& model) {
  ModelSummary out;
  out.count = model.size();
  out.sh_degree = model.sh_degree;
  if (out.count == 0) return out;

  constexpr std::array<double, 4> kBounds{0.0, 0.01, 0.99, 1.0};
  for (std::size_t k = 0; k < 3; ++k) {
    std::vector<double> axis(out.count);
    for (std::size_t i = 0; i < out.count; ++i)
      axis[i] = static_cast<double>(model.means[3 * i + k]);
    const std::vector<double> q = quantiles(std::move(axis), kBounds);
    out.minimum[k] = q[0];
    out.inner_minimum[k] = q[1];
    out.inner_maximum[k] = q[2];
    out.maximum[k] = q[3];
  }

  std::vector<double> logs(model.log_scales.begin(), model.log_scales.end());
  std::vector<double> ratios(out.count);
  for (std::size_t i = 0; i < out.count; ++i) {
    const auto [low, high] = std::minmax({logs[3 * i], logs[3 * i + 1], logs[3 * i + 2]});
    ratios[i] = high - low;
  }
  constexpr std::array<double, 5> kScales{0.0, 0.05, 0.5, 0.95, 1.0};
  const std::vector<double> scales = quantiles(std::move(logs), kScales);
  for (std::size_t k = 0; k < scales.size(); ++k) out.scale_quantiles[k] = std::exp(scales[k]);
  out.median_anisotropy = std::exp(median(std::move(ratios)));

  double sum = 0.0;
  for (const float logit : model.opacities) {
    const double opacity = sigmoid(static_cast<double>(logit));
    sum += opacity;
    const double bin = opacity * static_cast<double>(ModelSummary::kOpacityBins);
    ++out.opacity_histogram[std::min(static_cast<std::size_t>(bin),
                                     ModelSummary::kOpacityBins - 1)];
  }
  out.mean_opacity = sum / static_cast<double>(out.count);
  return out;
}

}  // namespace raysplats
