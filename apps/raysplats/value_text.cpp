// SPDX-License-Identifier: Apache-2.0
#include "value_text.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "util/number_text.hpp"

namespace raysplats::cli {
std::vector<std::string> parts_of(const std::string& text) {
  std::optional<std::vector<std::string>> parts = list_items({text});
  if (!parts) throw UsageError(fmt::format("'{}' is no list as in a,b", text));
  return std::move(*parts);
}

std::vector<std::string> names_of(const std::string& option,
                                  const std::string& text,
                                  const std::vector<std::string>& known) {
  std::vector<std::string> names = parts_of(text);
  for (const std::string& name : names) {
    if (std::find(known.begin(), known.end(), name) == known.end()) {
      throw UsageError(fmt::format("{} '{}' is none of {}", option, name, fmt::join(known, ", ")));
    }
  }
  if (names.empty()) {
    throw UsageError(fmt::format("{} names nothing: choose of {}", option, fmt::join(known, ", ")));
  }
  return names;
}

std::size_t parse_count(const std::string& option, const std::string& text) {
  const std::optional<std::uint64_t> value = parse_natural(text);
  if (!value || *value < 1 || *value > 1'000'000'000) {
    throw UsageError(
        fmt::format("{} '{}' is no number of Gaussians, as in 10000, 100k or 1M", option, text));
  }
  return static_cast<std::size_t>(*value);
}

double parse_duration(const std::string& option, const std::string& text) {
  double unit = 1;
  std::string digits = text;
  if (!digits.empty() && std::string_view("smh").find(digits.back()) != std::string_view::npos) {
    unit = digits.back() == 'h' ? 3600 : digits.back() == 'm' ? 60 : 1;
    digits.pop_back();
  }
  const std::optional<double> value = parse_real(digits);
  if (!value || !(*value * unit > 0) || *value * unit > 1e9) {
    throw UsageError(
        fmt::format("{} '{}' is no time to train in, as in 90s, 15m or 1.5h", option, text));
  }
  return *value * unit;
}

std::pair<int, int> parse_resolution(const std::string& text) {
  int width = 0, height = 0;
  const char* end = text.data() + text.size();
  const auto first = std::from_chars(text.data(), end, width);
  if (first.ec == std::errc() && first.ptr != end && *first.ptr == 'x') {
    const auto second = std::from_chars(first.ptr + 1, end, height);
    if (second.ec == std::errc() && second.ptr == end && width > 0 && height > 0 &&
        width <= kMaxSide && height <= kMaxSide) {
      return {width, height};
    }
  }
  throw UsageError(fmt::format("--resolution '{}' is not WIDTHxHEIGHT, as in 800x800", text));
}

std::string describe(const DeviceTuning& tuning) {
  const std::string group = tuning.group == 0 ? "whole tiles" : std::to_string(tuning.group);
  return fmt::format("packet width {}{}, tiles of {}, pending {}, groups of {}{}",
                     tuning.packet_width,
                     tuning.subgroups ? " as subgroups"
                     : tuning.grouped ? " as work-groups"
                                      : "",
                     tuning.tile, tuning.pending, group, tuning.bvh ? ", bvh" : "");
}

std::string readable_bytes(std::uint64_t bytes) {
  constexpr std::array<const char*, 5> kUnits{"B", "KiB", "MiB", "GiB", "TiB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  for (; value >= 1024.0 && unit + 1 < kUnits.size(); ++unit) value /= 1024.0;
  return fmt::format("{:.{}f} {}", value, unit == 0 ? 0 : 1, kUnits[unit]);
}

}  // namespace raysplats::cli
