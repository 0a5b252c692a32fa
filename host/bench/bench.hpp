// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "bench/report.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// A row that exists.
struct BenchRowInfo {
  std::string name;
  std::string unit;         ///< of its throughput
  std::string description;  ///< one line
};
/// All rows in the order they are run.
const std::vector<BenchRowInfo>& bench_rows();

struct BenchOptions {
  std::vector<std::string> scenes{"random"};  ///< of bench_scene_names()
  std::vector<std::size_t> sizes{10000, 100000, 1000000};
  int width = 800;
  int height = 800;
  int sh_degree = 0;
  std::string filter;  ///< regular expression, searched in the ids; "" = all
  int repeat = 5;
  double min_seconds = 0.02;          ///< per repetition
  std::size_t rays = 65536;           ///< arbitrary rays, at most
  std::size_t triangles = 1'000'000;  ///< of the larger body; the smaller has a tenth
  std::uint64_t seed = 1;
  /// Nothing more is begun after this moment.
  std::optional<std::chrono::steady_clock::time_point> deadline;
  /// What the device or a lack of memory makes fail is left out, with the error as reason.
  bool keep_failures = false;
  TraceOptions trace;
};

/// A model to measure on instead of generated scenes.
struct BenchModel {
  std::string name;
  Gaussians gaussians;
  Camera camera;
  bool unit_cube = false;  ///< the scene is [-1, 1]^3; else arbitrary rays go where most means are
};

/// The ids ("row/scene/size") that options.filter leaves. Throws UsageError for a filter that is no
/// regular expression.
std::vector<std::string> bench_ids(const BenchOptions& options, const BenchModel* model = nullptr);

/// Measures the rows and the device's limits. Needs a context with
/// keep_launches. `model` replaces scenes, sizes and resolution. Throws UsageError when the filter
/// leaves nothing.
BenchReport run_bench(Context& context,
                      const BenchOptions& options,
                      const BenchModel* model = nullptr);

}  // namespace raysplats
