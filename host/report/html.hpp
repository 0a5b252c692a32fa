// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace raysplats::report {

/// Text as it stands in XML, attributes included: &, <, > and quotes escaped, control characters
/// and bytes that are no UTF-8 replaced.
std::string escaped(std::string_view text);

/// Bytes as a data: address.
std::string data_url(std::string_view type, std::span<const unsigned char> bytes);

/// A line of a chart.
struct Curve {
  std::string name;
  std::vector<std::pair<double, double>> points;  ///< by rising x; others than finite are left out
};

/// A whole page: well-formed XML, no scripts, nothing from elsewhere, light and dark. `title` is
/// escaped here, `body` has been.
std::string page(std::string_view title, std::string_view body);

/// Colours of curves and of headings, in classes c0, c1, ...; further ones begin again.
constexpr std::size_t kColors = 6;

/// Curves as an SVG with axes, a grid and a legend, named for readers that do not see it. Curves of
/// many points keep the least and greatest of each column. Empty without points.
std::string chart(std::string_view title, std::string_view x_label, std::span<const Curve> curves);

}  // namespace raysplats::report
