// SPDX-License-Identifier: Apache-2.0
#include "scene/statistics.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>

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
  std::size_t settled = 0;  // from here on values are in no order, before it none is greater
  double last = 0.0;
  for (std::size_t k = 0; k < q.size(); ++k) {
    if (q[k] < last) settled = 0;
    last = q[k];
    const double position = q[k] * static_cast<double>(values.size() - 1);
    const auto low = static_cast<std::size_t>(std::floor(position));
    const auto at = [&values](std::size_t i) {
      return values.begin() + static_cast<std::ptrdiff_t>(i);
    };
    std::nth_element(at(settled), at(low), values.end());
    settled = low;
    const double share = position - static_cast<double>(low);
    const double next =
        low + 1 < values.size() ? *std::min_element(at(low + 1), values.end()) : values[low];
    out[k] = values[low] + share * (next - values[low]);
  }
  return out;
}

double median(std::vector<double> values) {
  const double half = 0.5;
  return quantiles(std::move(values), std::span(&half, 1))[0];
}

}  // namespace raysplats
