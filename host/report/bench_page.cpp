// SPDX-License-Identifier: Apache-2.0
#include "report/bench_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <string_view>
#include <vector>

#include "bench/format.hpp"
#include "report/chart.hpp"
#include "report/html.hpp"

namespace raysplats {
namespace {

using namespace report;

/// Rows that belong into one chart, as many as its legend has room for.
struct Group {
  std::string_view title;
  std::vector<std::string_view> rows;
};

const std::vector<Group>& groups() {
  static const std::vector<Group> all{
      {"The tree", {"build", "refit", "rays", "view-bvh"}},
      {"An image by tiles", {"prepare-view", "tile-lists", "forward", "view"}},
      {"Training", {"backward", "loss-gradient", "adam", "iteration"}},
      {"Scenes with meshes", {"light", "light-mirror", "light-glass", "light-shadows"}}};
  return all;
}

std::string cell(const std::string& text) { return "<td>" + escaped(text) + "</td>"; }

std::string rows_of(const BenchReport& report, const std::string& scene, std::size_t size) {
  std::string out =
      "<table>\n<tr><th>row</th><th>ms</th><th>±</th><th>rate</th><th></th><th>of the copy "
      "rate</th><th>of the FMA rate</th></tr>\n";
  for (const BenchRow& row : report.rows) {
    if (row.scene != scene || row.size != size) continue;
    const BenchShare share = share_of(row, report.ceilings);
    out += fmt::format("<tr><th>{}</th>", escaped(row.name)) +
           cell(format_milliseconds(row.seconds.median)) +
           cell(format_milliseconds(row.seconds.deviation)) + cell(format_rate(row, 0)) +
           cell(row.work.items.size() > 1 ? format_rate(row, 1) : "") + share_cell(share.copy) +
           share_cell(share.fma) + "</tr>\n";
  }
  return out + "</table>\n";
}

std::string charts_of(const BenchReport& report, const std::string& scene) {
  std::string out;
  for (const Group& group : groups()) {
    std::vector<Curve> curves;
    for (const std::string_view name : group.rows) {
      Curve curve{std::string(name), {}};
      for (const BenchRow& row : report.rows) {
        if (row.scene == scene && row.name == name && row.size > 0 && row.seconds.median > 0) {
          curve.points.emplace_back(std::log10(static_cast<double>(row.size)),
                                    std::log10(1e3 * row.seconds.median));
        }
      }
      std::sort(curve.points.begin(), curve.points.end());
      if (!curve.points.empty()) curves.push_back(std::move(curve));
    }
    out +=
        chart(fmt::format("{}: log10 of milliseconds", group.title), "log10 of Gaussians", curves);
  }
  return "<div class=\"charts\">\n" + out + "</div>\n";
}

std::string about(const BenchReport& report) {
  std::string out = "<table>\n";
  const auto line = [&](std::string_view what, const std::string& value) {
    out += fmt::format("<tr><th>{}</th><td>{}</td></tr>\n", escaped(what), escaped(value));
  };
  line("Device", report.device);
  line("Driver", fmt::format("{}, {}", report.platform, report.driver));
  line("Compute units", fmt::format("{}", report.compute_units));
  line("Measured limits", fmt::format("copy {:.1f} GB/s, FMA {:.1f} GFLOP/s",
                                      1e-9 * report.ceilings.copy_bytes_per_second,
                                      1e-9 * report.ceilings.fma_flops_per_second));
  line("Peak memory", fmt::format("process {:.1f} MiB, device buffers {:.1f} MiB",
                                  static_cast<double>(report.peak_process_bytes) / (1 << 20),
                                  static_cast<double>(report.peak_device_bytes) / (1 << 20)));
  line("Date", report.date);
  for (const auto& [key, value] : report.options) line(key, value);
  return out + "</table>\n";
}

}  // namespace

std::string bench_page(const BenchReport& report) {
  std::string body = about(report);
  std::vector<std::string> scenes;
  for (const BenchRow& row : report.rows) {
    if (std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
      scenes.push_back(row.scene);
  }
  for (const std::string& scene : scenes) {
    std::set<std::size_t> sizes;
    for (const BenchRow& row : report.rows) {
      if (row.scene == scene) sizes.insert(row.size);
    }
    if (sizes.size() > 1) {
      body += fmt::format("<h2>{}: how times grow</h2>\n", escaped(scene));
      body += charts_of(report, scene);
    }
    for (const std::size_t size : sizes) {
      body += fmt::format("<h2>{}, {} Gaussians</h2>\n", escaped(scene), size);
      body += rows_of(report, scene, size);
    }
  }
  for (const std::string& line : left_out_lines(report))
    body += fmt::format("<p class=\"warn\">Left out: {}</p>\n", escaped(line));
  return page("Benchmark of " + report.device, body);
}

}  // namespace raysplats
