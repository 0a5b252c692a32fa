// SPDX-License-Identifier: Apache-2.0
#include "bench/format.hpp"

#include <fmt/format.h>

#include <array>

namespace raysplats {
namespace {

// 12.3 k, 4.56 M and so on; three digits are more than repetitions agree on.
std::string engineering(double value) {
  constexpr std::array<const char*, 5> kPrefixes{"", "k", "M", "G", "T"};
  std::size_t prefix = 0;
  for (; value >= 999.5 && prefix + 1 < kPrefixes.size(); ++prefix) value /= 1000.0;
  return fmt::format("{:.3g} {}", value, kPrefixes[prefix]);
}

}  // namespace

std::string format_milliseconds(double seconds) {
  const double ms = 1e3 * seconds;
  return fmt::format("{:.{}f}", ms, ms < 1 ? 4 : ms < 100 ? 3 : 1);
}

std::string format_rate(const BenchRow& row, std::size_t index) {
  if (index >= row.work.items.size() || row.seconds.median <= 0) return "-";
  const BenchWork::Items& items = row.work.items[index];
  return fmt::format("{}{}/s", engineering(items.count / row.seconds.median), items.unit);
}

}  // namespace raysplats
