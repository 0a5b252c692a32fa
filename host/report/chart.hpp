// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace raysplats::report {

/// A line of a chart.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< by rising x; others than finite are left out
};

/// Curves as an SVG with axes, a grid and a legend, named for readers that do not see it. Curves of
/// many points keep the least and greatest of each column. Empty without points.
std::string chart(std::string_view title, std::string_view x_label, std::span<const Curve> curves);

/// How many of the values lie where between `low` and `high`, as an SVG of bars; those beyond count
/// at the ends.
std::string histogram(std::string_view title,
                      std::string_view x_label,
                      std::span<const double> values,
                      double low,
                      double high);

}  // namespace raysplats::report
