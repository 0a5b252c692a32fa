// SPDX-License-Identifier: Apache-2.0
#include "bench/report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "bench/format.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

std::string percent(double share) { return share > 0 ? fmt::format("{:.1f}", 100 * share) : "-"; }

}  // namespace

std::string BenchRow::id() const { return fmt::format("{}/{}/{}", name, scene, size); }

BenchShare share_of(const BenchRow& row, const Ceilings& ceilings) {
  BenchShare share;
  const double seconds = row.seconds.median;
  if (!(seconds > 0)) return share;
  if (ceilings.copy_bytes_per_second > 0) {
    share.copy = row.work.bytes / seconds / ceilings.copy_bytes_per_second;
  }
  if (ceilings.fma_flops_per_second > 0) {
    share.fma = row.work.flops / seconds / ceilings.fma_flops_per_second;
  }
  if (share.copy > 0 || share.fma > 0) share.bound = share.copy >= share.fma ? "copy" : "fma";
  return share;
}

std::vector<std::string> left_out_lines(const BenchReport& report) {
  std::map<std::string, std::string> ids;
  for (const BenchReport::LeftOut& row : report.left_out) {
    std::string& line = ids[row.reason];
    line += (line.empty() ? "" : " ") + row.id;
  }
  std::vector<std::string> out;
  out.reserve(ids.size());
  for (const auto& [reason, line] : ids) out.push_back(fmt::format("{}: {}", line, reason));
  return out;
}

std::string bench_table(const BenchReport& report) {
  std::string out = fmt::format("{} ({}, driver {}), raysplats {}\n", report.device,
                                report.platform, report.driver, report.version);
  out += fmt::format("measured limits: copy {:.1f} GB/s, FMA {:.1f} GFLOP/s\n",
                     1e-9 * report.ceilings.copy_bytes_per_second,
                     1e-9 * report.ceilings.fma_flops_per_second);
  std::size_t widest = 4;
  for (const BenchRow& row : report.rows) widest = std::max(widest, row.id().size());
  out +=
      fmt::format("{:<{}} {:>10} {:>9} {:>10} {:>20} {:>18} {:>8} {:>6} {:>9} {:>6}\n", "row",
                  widest, "ms", "+- ms", "wall ms", "rate", "", "GB/s", "copy%", "GFLOP/s", "FMA%");
  for (const BenchRow& row : report.rows) {
    const BenchShare share = share_of(row, report.ceilings);
    const double seconds = std::max(row.seconds.median, 1e-12);
    out += fmt::format(
        "{:<{}} {:>10} {:>9} {:>10} {:>20} {:>18} {:>8.2f} {:>6} {:>9.2f} {:>6}\n", row.id(),
        widest, format_milliseconds(row.seconds.median), format_milliseconds(row.seconds.deviation),
        row.wall ? format_milliseconds(*row.wall) : "", format_rate(row, 0),
        row.work.items.size() > 1 ? format_rate(row, 1) : "", 1e-9 * row.work.bytes / seconds,
        percent(share.copy), 1e-9 * row.work.flops / seconds, percent(share.fma));
  }
  for (const std::string& line : left_out_lines(report)) out += fmt::format("left out: {}\n", line);
  out += fmt::format("peak memory: process {:.1f} MiB, device buffers {:.1f} MiB\n",
                     mib(report.peak_process_bytes), mib(report.peak_device_bytes));
  return out;
}

std::string bench_csv(const BenchReport& report) {
  std::string out =
      "row,scene,size,clock,median_s,deviation_s,minimum_s,maximum_s,samples,wall_s,unit,items,"
      "items_per_s,second_unit,second_items,bytes,flops,copy_share,fma_share,bound\n";
  for (const BenchRow& row : report.rows) {
    const BenchShare share = share_of(row, report.ceilings);
    const auto& items = row.work.items;
    const BenchWork::Items first = items.empty() ? BenchWork::Items{} : items[0];
    const BenchWork::Items second = items.size() < 2 ? BenchWork::Items{} : items[1];
    // A scene may be a file's name: quotes and commas are its own affair.
    std::string scene;
    for (const char c : row.scene) scene += c == '"' ? std::string("\"\"") : std::string(1, c);
    out += fmt::format(
        "{},\"{}\",{},{},{:.9g},{:.9g},{:.9g},{:.9g},{},{},{},{:.9g},{:.9g},{},{:.9g},{:.9g},{:.9g}"
        ",{:.6g},{:.6g},{}\n",
        row.name, scene, row.size, row.clock, row.seconds.median, row.seconds.deviation,
        row.seconds.minimum, row.seconds.maximum, row.seconds.samples,
        row.wall ? fmt::format("{:.9g}", *row.wall) : "", first.unit, first.count,
        row.seconds.median > 0 ? first.count / row.seconds.median : 0.0, second.unit, second.count,
        row.work.bytes, row.work.flops, share.copy, share.fma, share.bound);
  }
  return out;
}

}  // namespace raysplats
