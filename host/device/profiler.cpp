// SPDX-License-Identifier: Apache-2.0
#include "device/profiler.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace raysplats {

void Profiler::add(const std::string& kernel, std::uint64_t nanoseconds) {
  Entry& entry = entries_[kernel];
  entry.calls += 1;
  entry.nanoseconds += nanoseconds;
}

std::vector<Profiler::Row> Profiler::rows() const {
  double sum = 0;
  for (const auto& [name, entry] : entries_) sum += static_cast<double>(entry.nanoseconds);
  std::vector<Row> rows;
  for (const auto& [name, entry] : entries_) {
    const double total = static_cast<double>(entry.nanoseconds);
    rows.push_back({name, entry.calls, total * 1e-6,
                    total * 1e-6 / static_cast<double>(entry.calls), sum > 0 ? total / sum : 0});
  }
  std::sort(rows.begin(), rows.end(),
            [](const Row& a, const Row& b) { return a.total_ms > b.total_ms; });
  return rows;
}

std::string Profiler::table() const {
  std::string out = fmt::format("{:<28} {:>9} {:>12} {:>10} {:>7}\n", "kernel", "calls", "total ms",
                                "mean ms", "share");
  for (const Row& row : rows()) {
    out += fmt::format("{:<28} {:>9} {:>12.2f} {:>10.3f} {:>6.1f}%\n", row.kernel, row.calls,
                       row.total_ms, row.mean_ms, row.share * 100);
  }
  return out;
}

}  // namespace raysplats
