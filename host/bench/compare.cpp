// SPDX-License-Identifier: Apache-2.0
#include "bench/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace raysplats {
namespace {

constexpr double kDeviations = 3.0;
constexpr std::size_t kFewSamples = 4;

double spread_of(const Summary& summary) {
  const double spread = kDeviations * summary.deviation;
  if (summary.samples >= kFewSamples) return spread;
  return std::max(spread, 0.5 * (summary.maximum - summary.minimum));
}

const BenchRow* find_row(const BenchReport& report, const std::string& id) {
  const auto found = std::find_if(report.rows.begin(), report.rows.end(),
                                  [&](const BenchRow& row) { return row.id() == id; });
  return found == report.rows.end() ? nullptr : &*found;
}

void note(std::vector<std::string>& out,
          const std::string& what,
          const std::string& before,
          const std::string& after) {
  if (before != after) out.push_back(fmt::format("{}: {} -> {}", what, before, after));
}

// Earlier versions keep fewer.
std::string option_of(const BenchReport& report, const std::string& name) {
  const auto found = report.options.find(name);
  return found == report.options.end() ? "not in the file" : found->second;
}

}  // namespace

BenchComparison compare_reports(const BenchReport& before, const BenchReport& after) {
  BenchComparison out;
  note(out.differing, "device", before.device, after.device);
  note(out.differing, "driver", before.driver, after.driver);
  note(out.differing, "raysplats", before.version, after.version);
  std::set<std::string> options;
  for (const auto& [name, value] : before.options) options.insert(name);
  for (const auto& [name, value] : after.options) options.insert(name);
  for (const std::string& name : options)
    note(out.differing, "--" + name, option_of(before, name), option_of(after, name));
  for (const BenchRow& row : before.rows) {
    const BenchRow* other = find_row(after, row.id());
    if (other == nullptr) {
      out.only_before.push_back(row.id());
      continue;
    }
    BenchDifference difference;
    difference.id = row.id();
    difference.before = row.seconds.median;
    difference.after = other->seconds.median;
    difference.ratio = row.seconds.median > 0 ? other->seconds.median / row.seconds.median : 0.0;
    const double spread = spread_of(row.seconds) + spread_of(other->seconds);
    difference.spread = row.seconds.median > 0 ? spread / row.seconds.median : 0.0;
    difference.significant = std::abs(difference.after - difference.before) > spread;
    out.rows.push_back(difference);
  }
  for (const BenchRow& row : after.rows) {
    if (find_row(before, row.id()) == nullptr) out.only_after.push_back(row.id());
  }
  return out;
}

std::string comparison_table(const BenchComparison& comparison) {
  std::string out;
  for (const std::string& text : comparison.differing) out += text + "\n";
  std::size_t widest = 3;
  for (const BenchDifference& row : comparison.rows) widest = std::max(widest, row.id.size());
  out +=
      fmt::format("{:<{}} {:>12} {:>12} {:>8} {:>7}\n", "row", widest, "A ms", "B ms", "B/A", "+-");
  for (const BenchDifference& row : comparison.rows) {
    out += fmt::format("{:<{}} {:>12.4f} {:>12.4f} {:>8.3f} {:>7.3f}{}\n", row.id, widest,
                       1e3 * row.before, 1e3 * row.after, row.ratio, row.spread,
                       row.significant ? " *" : "");
  }
  for (const std::string& id : comparison.only_before) out += fmt::format("only in A: {}\n", id);
  for (const std::string& id : comparison.only_after) out += fmt::format("only in B: {}\n", id);
  out += "* the medians differ by more than both spreads\n";
  return out;
}

}  // namespace raysplats
