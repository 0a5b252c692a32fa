// SPDX-License-Identifier: Apache-2.0
#include "bench/summary.hpp"

#include <algorithm>
#include <cmath>

namespace raysplats {
namespace {

double median_of(std::vector<double>& values) {
  std::sort(values.begin(), values.end());
  const std::size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

}  // namespace

Summary summarize(std::vector<double> samples) {
  Summary out;
  if (samples.empty()) return out;
  out.samples = samples.size();
  out.median = median_of(samples);
  out.minimum = samples.front();
  out.maximum = samples.back();
  for (double& value : samples) value = std::abs(value - out.median);
  out.deviation = median_of(samples);
  return out;
}

}  // namespace raysplats
