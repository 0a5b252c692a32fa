// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raysplats {

/// Repeated measurements of one quantity, robust against the odd disturbed one.
struct Summary {
  std::size_t samples = 0;
  double median = 0;
  double deviation = 0;  ///< median absolute deviation from the median
  double minimum = 0;
  double maximum = 0;
};

/// Zeros for no samples. O(N log N).
Summary summarize(std::vector<double> samples);

}  // namespace raysplats
