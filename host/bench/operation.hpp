// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "bench/kept_failure.hpp"
#include "bench/report.hpp"
#include "device/context.hpp"

namespace raysplats {

/// One row that an operation yields.
struct BenchStage {
  std::string name;
  /// Starts of "program:kernel" ("bvh/curve.cl", "train/loss_ssim.cl:loss_gradient", ":(fill)");
  /// none means all launches, and the host's clock is reported beside the device's.
  std::vector<std::string> launches;
  bool wall = false;  ///< the host's clock counts: the host does part of the work
  /// What one run did; asked after the runs.
  std::function<BenchWork()> work;

  bool takes(const LaunchTime& launch) const;
};

/// Something that is run as a whole and yields one or several rows.
struct BenchOperation {
  std::function<void()> prepare;  ///< once, untimed
  std::function<void()> reset;    ///< before every run, untimed; may be empty
  std::function<void()> run;
  std::vector<BenchStage> stages;
  bool optional = false;  ///< what the device does not have leaves it out
};

struct StageSamples {
  std::vector<double> seconds;  ///< one per repetition, by the stage's clock
  std::vector<double> wall;     ///< of the whole operation
  std::string lacking;          ///< why the device left it out, where it did
  KeptFailure failure;          ///< what it threw, where that is kept
};

/// Runs every operation: once to warm up, then `repeat` times as often as Google Benchmark finds
/// necessary for `min_seconds` each. No repetition begins once `out_of_time()` says so; an
/// operation that never began has no samples. The result is parallel to operations and their
/// stages. Needs a context with keep_launches. What an operation throws ends the run and is thrown
/// on, but for the device's refusal of one that is optional. With `keep_failures` what is of
/// failure_of()'s kinds is told in the operation's samples instead; those behind it never began.
std::vector<std::vector<StageSamples>> run_operations(Context& context,
                                                      const std::vector<BenchOperation>& operations,
                                                      int repeat,
                                                      double min_seconds,
                                                      const std::function<bool()>& out_of_time = {},
                                                      bool keep_failures = false);

}  // namespace raysplats
