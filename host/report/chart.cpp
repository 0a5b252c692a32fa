// SPDX-License-Identifier: Apache-2.0
#include "report/chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <limits>

#include "report/html.hpp"

namespace raysplats::report {
namespace {

constexpr double kWidth = 460.0;
constexpr double kHeight = 230.0;
constexpr double kLeft = 52.0;
constexpr double kRight = 12.0;
constexpr double kTop = 30.0;
constexpr double kBottom = 36.0;
constexpr std::size_t kBars = 40;
constexpr std::size_t kColumns = 400;  ///< of a curve; each keeps its extremes

using Points = std::vector<std::pair<double, double>>;

Points thinned(const Points& points) {
  if (points.size() <= 2 * kColumns) return points;
  Points out;
  for (std::size_t column = 0; column < kColumns; ++column) {
    const auto begin =
        points.begin() + static_cast<std::ptrdiff_t>(column * points.size() / kColumns);
    const auto end =
        points.begin() + static_cast<std::ptrdiff_t>((column + 1) * points.size() / kColumns);
    auto [low, high] = std::minmax_element(
        begin, end, [](const auto& a, const auto& b) { return a.second < b.second; });
    if (high < low) std::swap(low, high);
    out.push_back(*low);
    if (high != low) out.push_back(*high);
  }
  return out;
}

/// Round numbers between low and high.
std::vector<double> ticks(double low, double high) {
  constexpr double kWanted = 4.0;
  const double raw = (high - low) / kWanted;
  const double power = std::pow(10.0, std::floor(std::log10(raw)));
  const double step = power * (raw / power > 5.0   ? 10.0
                               : raw / power > 2.0 ? 5.0
                               : raw / power > 1.0 ? 2.0
                                                   : 1.0);
  std::vector<double> out;
  for (double at = std::ceil(low / step) * step; at <= high + 1e-9 * step && out.size() < 20;
       at += step)
    out.push_back(std::abs(at) < 1e-9 * step ? 0.0 : at);
  return out;
}

std::string short_number(double value) {
  const double size = std::abs(value);
  if (size >= 1e6) return fmt::format("{:.3g}M", value / 1e6);
  if (size >= 1e4) return fmt::format("{:.3g}k", value / 1e3);
  return fmt::format("{:.4g}", value);
}

struct Range {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
  void widen() {
    if (!(high > low)) {
      const double margin = std::max(0.5, 0.05 * std::abs(low));
      low -= margin;
      high += margin;
    }
  }
  double share(double value) const { return (value - low) / (high - low); }
};

/// The part of a chart that shows its numbers, and its axes.
struct Axes {
  Range x, y;

  double place_x(double value) const { return kLeft + x.share(value) * (kWidth - kLeft - kRight); }
  double place_y(double value) const {
    return kHeight - kBottom - y.share(value) * (kHeight - kTop - kBottom);
  }
  /// The beginning of the SVG.
  std::string drawn(std::string_view title, std::string_view x_label) const {
    std::string out = fmt::format(
        "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\"><text x=\"{}\" y=\"16\" "
        "class=\"title\">{}</text>",
        kWidth, kHeight, escaped(title), kLeft, escaped(title));
    for (const double at : ticks(y.low, y.high)) {
      out += fmt::format(
          "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/><text x=\"{3}\" "
          "y=\"{4:.1f}\" "
          "text-anchor=\"end\">{5}</text>",
          kLeft, kWidth - kRight, place_y(at), kLeft - 5, place_y(at) + 4, short_number(at));
    }
    for (const double at : ticks(x.low, x.high)) {
      out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>",
                         place_x(at), kHeight - kBottom + 15, short_number(at));
    }
    out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", kWidth - kRight,
                       kHeight - 5, escaped(x_label));
    return out;
  }
};

}  // namespace

std::string chart(std::string_view title, std::string_view x_label, std::span<const Curve> curves) {
  Axes axes;
  std::vector<Points> drawn;
  for (const Curve& curve : curves) {
    Points finite;
    std::copy_if(curve.points.begin(), curve.points.end(), std::back_inserter(finite),
                 [](const auto& p) { return std::isfinite(p.first) && std::isfinite(p.second); });
    for (const auto& [px, py] : finite) {
      axes.x.add(px);
      axes.y.add(py);
    }
    drawn.push_back(thinned(finite));
  }
  if (!(axes.x.high >= axes.x.low)) return "";
  axes.x.widen();
  axes.y.widen();
  std::string out = axes.drawn(title, x_label);
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    std::string places;
    for (const auto& [px, py] : drawn[i])
      places += fmt::format("{:.1f},{:.1f} ", axes.place_x(px), axes.place_y(py));
    out += fmt::format("<polyline class=\"c{}\" points=\"{}\"/>", i % kColors, places);
    if (drawn[i].size() <= 30) {
      for (const auto& [px, py] : drawn[i])
        out += fmt::format("<circle class=\"c{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\"/>",
                           i % kColors, axes.place_x(px), axes.place_y(py));
    }
    if (drawn.size() > 1) {
      out += fmt::format("<text class=\"c{}\" x=\"{}\" y=\"{}\">{}</text>", i % kColors,
                         kLeft + std::min(110.0, 300.0 / static_cast<double>(drawn.size())) *
                                     static_cast<double>(i),
                         kHeight - 5, escaped(curves[i].name));
    }
  }
  return out + "</svg>\n";
}

std::string histogram(std::string_view title,
                      std::string_view x_label,
                      std::span<const double> values,
                      double low,
                      double high) {
  std::array<double, kBars> counts{};
  for (const double value : values) {
    if (std::isnan(value)) continue;
    const double at = std::clamp((value - low) / (high - low) * kBars, 0.0, kBars - 1.0);
    counts[static_cast<std::size_t>(at)] += 1;
  }
  const Axes axes{{low, high}, {0, std::max(1.0, *std::max_element(counts.begin(), counts.end()))}};
  std::string out = axes.drawn(title, x_label);
  const double width = (kWidth - kLeft - kRight) / kBars;
  for (std::size_t i = 0; i < kBars; ++i) {
    const double top = axes.place_y(counts[i]);
    out += fmt::format(
        "<rect class=\"c0\" x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\"/>",
        kLeft + static_cast<double>(i) * width, top, width - 1, axes.place_y(0) - top);
  }
  return out + "</svg>\n";
}

}  // namespace raysplats::report
