// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

namespace raysplats {

/// The value below which a share `q` (0..1) of the total weight lies; weights are not negative.
/// When all of them are zero every value counts the same. Returns 0 for no values. O(N log N).
double weighted_quantile(std::span<const double> values, std::span<const double> weights, double q);

/// Quantiles of equally weighted values, linearly interpolated, one per entry of `q` (each 0..1);
/// zeros for no values. O(N) for each of them.
std::vector<double> quantiles(std::vector<double> values, std::span<const double> q);
/// The quantile 0.5.
double median(std::vector<double> values);

}  // namespace raysplats
