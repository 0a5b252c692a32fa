// SPDX-License-Identifier: Apache-2.0
#include "report/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace raysplats::report {
namespace {

constexpr double kWidth = 460.0;
constexpr double kHeight = 230.0;
constexpr double kLeft = 52.0;
constexpr double kRight = 12.0;
constexpr double kTop = 30.0;
constexpr double kBottom = 36.0;
constexpr std::size_t kColumns = 400;  ///< of a curve; each keeps its extremes

using Points = std::vector<std::pair<double, double>>;

/// Bytes of the character that starts here, 0 when it is no UTF-8.
std::size_t character(std::string_view text) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const std::size_t size = byte(0) < 0x80   ? 1
                           : byte(0) < 0xc2 ? 0
                           : byte(0) < 0xe0 ? 2
                           : byte(0) < 0xf0 ? 3
                           : byte(0) < 0xf5 ? 4
                                            : 0;
  if (size > text.size()) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
  }
  // Too long a form, and what UTF-8 has no characters for.
  if (size == 3 && ((byte(0) == 0xe0 && byte(1) < 0xa0) || (byte(0) == 0xed && byte(1) > 0x9f) ||
                    (byte(0) == 0xef && byte(1) == 0xbf && byte(2) > 0xbd)))
    return 0;
  if (size == 4 && ((byte(0) == 0xf0 && byte(1) < 0x90) || (byte(0) == 0xf4 && byte(1) > 0x8f)))
    return 0;
  return size;
}

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

}  // namespace

std::string escaped(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const std::size_t size = character(text);
    const char c = text.front();
    if (size == 0) {
      out += "\xef\xbf\xbd";
    } else if (size > 1) {
      out += text.substr(0, size);
    } else if (c == '&') {
      out += "&amp;";
    } else if (c == '<') {
      out += "&lt;";
    } else if (c == '>') {
      out += "&gt;";
    } else if (c == '"') {
      out += "&quot;";
    } else if (c == '\'') {
      out += "&#39;";
    } else if (static_cast<unsigned char>(c) < 0x20 && c != '\n' && c != '\t') {
      out += "\xef\xbf\xbd";
    } else {
      out += c;
    }
    text.remove_prefix(std::max<std::size_t>(size, 1));
  }
  return out;
}

std::string data_url(std::string_view type, std::span<const unsigned char> bytes) {
  static constexpr char kLetters[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out = fmt::format("data:{};base64,", type);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const auto at = [&](std::size_t k) {
      return i + k < bytes.size() ? static_cast<unsigned>(bytes[i + k]) : 0u;
    };
    const unsigned word = at(0) << 16 | at(1) << 8 | at(2);
    out += kLetters[word >> 18];
    out += kLetters[word >> 12 & 63];
    out += i + 1 < bytes.size() ? kLetters[word >> 6 & 63] : '=';
    out += i + 2 < bytes.size() ? kLetters[word & 63] : '=';
  }
  return out;
}

std::string chart(std::string_view title, std::string_view x_label, std::span<const Curve> curves) {
  Range x;
  Range y;
  std::vector<Points> drawn;
  for (const Curve& curve : curves) {
    Points finite;
    std::copy_if(curve.points.begin(), curve.points.end(), std::back_inserter(finite),
                 [](const auto& p) { return std::isfinite(p.first) && std::isfinite(p.second); });
    for (const auto& [px, py] : finite) {
      x.add(px);
      y.add(py);
    }
    drawn.push_back(thinned(finite));
  }
  if (!(x.high >= x.low)) return "";
  x.widen();
  y.widen();
  const auto place_x = [&](double value) {
    return kLeft + x.share(value) * (kWidth - kLeft - kRight);
  };
  const auto place_y = [&](double value) {
    return kHeight - kBottom - y.share(value) * (kHeight - kTop - kBottom);
  };
  std::string out = fmt::format(
      "<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\"><text x=\"{}\" y=\"16\" "
      "class=\"title\">{}</text>",
      kWidth, kHeight, escaped(title), kLeft, escaped(title));
  for (const double at : ticks(y.low, y.high)) {
    out += fmt::format(
        "<line x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\"/><text x=\"{3}\" y=\"{4:.1f}\" "
        "text-anchor=\"end\">{5}</text>",
        kLeft, kWidth - kRight, place_y(at), kLeft - 5, place_y(at) + 4, short_number(at));
  }
  for (const double at : ticks(x.low, x.high)) {
    out += fmt::format("<text x=\"{:.1f}\" y=\"{}\" text-anchor=\"middle\">{}</text>", place_x(at),
                       kHeight - kBottom + 15, short_number(at));
  }
  out += fmt::format("<text x=\"{}\" y=\"{}\" text-anchor=\"end\">{}</text>", kWidth - kRight,
                     kHeight - 5, escaped(x_label));
  for (std::size_t i = 0; i < drawn.size(); ++i) {
    std::string places;
    for (const auto& [px, py] : drawn[i])
      places += fmt::format("{:.1f},{:.1f} ", place_x(px), place_y(py));
    out += fmt::format("<polyline class=\"c{}\" points=\"{}\"/>", i, places);
    if (drawn[i].size() <= 30) {
      for (const auto& [px, py] : drawn[i])
        out += fmt::format("<circle class=\"c{}\" cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.5\"/>", i,
                           place_x(px), place_y(py));
    }
    if (drawn.size() > 1) {
      out +=
          fmt::format("<text class=\"c{}\" x=\"{}\" y=\"{}\">{}</text>", i,
                      kLeft + 110.0 * static_cast<double>(i), kHeight - 5, escaped(curves[i].name));
    }
  }
  return out + "</svg>\n";
}

}  // namespace raysplats::report
