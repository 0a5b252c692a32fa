// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bench/bench.hpp"
#include "bench/report.hpp"

/// Every operation in little time.
inline raysplats::BenchOptions tiny_bench(int repeat) {
  raysplats::BenchOptions options;
  options.sizes = {1000};
  options.width = options.height = 64;
  options.repeat = repeat;
  options.min_seconds = 1e-4;
  options.rays = 256;
  options.triangles = 2000;
  return options;
}

/// Of a context that benchmarks run in.
inline raysplats::ContextOptions timed_options() {
  raysplats::ContextOptions options;
  options.profile = options.keep_launches = true;
  options.tuning = false;
  return options;
}

/// Two rows with figures that are easy to compute with.
inline raysplats::BenchReport sample_report() {
  using namespace raysplats;
  BenchReport report;
  report.version = "1.2.3";
  report.date = "2026-01-02T03:04:05Z";
  report.device = "Device, \"quoted\"";
  report.driver = "driver";
  report.platform = "platform";
  report.compute_units = 7;
  report.options = {{"repeat", "5"}, {"resolution", "8x6"}};
  report.ceilings = {2e10, 1e12};
  report.peak_process_bytes = 1 << 20;
  report.peak_device_bytes = 1 << 21;
  BenchRow row;
  row.name = "forward";
  row.scene = "random";
  row.size = 1000;
  row.clock = "device";
  row.seconds = {5, 0.5, 0.01, 0.4, 0.6};
  row.work = {{{"rays", 1e6}, {"hits", 4e7}}, 1e9, 1e11};
  report.rows.push_back(row);
  row.name = "densify";
  row.clock = "wall";
  row.seconds = {5, 0.002, 0.0, 0.002, 0.002};
  row.wall = 0.002;
  row.work = {{{"Gaussians", 1000}}, 8e6, 0};
  report.rows.push_back(row);
  return report;
}
