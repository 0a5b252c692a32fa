// SPDX-License-Identifier: Apache-2.0
#include "core/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>

namespace raysplats {

double weighted_quantile(std::span<const double> values,
                         std::span<const double> weights,
                         double q) {
  if (values.empty()) return 0.0;
  const double total = std::accumulate(weights.begin(), weights.end(), 0.0);
  const auto weight = [&](std::size_t i) { return total > 0.0 ? weights[i] : 1.0; };
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  const double target = q * (total > 0.0 ? total : static_cast<double>(values.size()));
  double sum = 0.0;
  for (const std::size_t i : order) {
    sum += weight(i);
    if (sum >= target) return values[i];
  }
  return values[order.back()];
}

std::vector<double> quantiles(std::vector<double> values, std::span<const double> q) {
  std::vector<double> out(q.size(), 0.0);
  if (values.empty()) return out;
  std::sort(values.begin(), values.end());
  for (std::size_t k = 0; k < q.size(); ++k) {
    const double position = q[k] * static_cast<double>(values.size() - 1);
    const auto low = static_cast<std::size_t>(std::floor(position));
    const std::size_t high = std::min(low + 1, values.size() - 1);
    const double share = position - static_cast<double>(low);
    out[k] = values[low] + share * (values[high] - values[low]);
  }
  return out;
}

}  // namespace raysplats
