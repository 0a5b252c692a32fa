// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bench/report.hpp"

namespace raysplats {

struct BenchDifference {
  std::string id;
  double before = 0;         ///< median seconds in A
  double after = 0;          ///< in B
  double ratio = 0;          ///< after / before
  double spread = 0;         ///< of both medians together, over `before`
  bool significant = false;  ///< the medians differ by more than both spreads together
};

struct BenchComparison {
  std::vector<BenchDifference> rows;  ///< in A's order
  std::vector<std::string> only_before;
  std::vector<std::string> only_after;
  std::vector<std::string> differing;  ///< what else differs: devices, drivers, options
};

/// Rows are matched by id(). The spread of a row is three median absolute deviations, which holds
/// about 95 % of normally distributed samples, and at least half of max - min where there are only
/// two or three samples.
BenchComparison compare_reports(const BenchReport& before, const BenchReport& after);

/// Fixed-width text: ids, medians, ratio, and "*" where the difference is significant.
std::string comparison_table(const BenchComparison& comparison);

}  // namespace raysplats
