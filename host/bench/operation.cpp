// SPDX-License-Identifier: Apache-2.0
#include "bench/operation.hpp"

#include <benchmark/benchmark.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <exception>

#include "raysplats/error.hpp"
#include "util/clock.hpp"

namespace raysplats {
namespace {

constexpr const char* kWall = "wall";

std::string counter_name(std::size_t stage) { return fmt::format("stage{}", stage); }

// Runs the operation once and returns the host's seconds; adds each stage's seconds to `sums`.
double run_once(Context& context, const BenchOperation& operation, std::vector<double>& sums) {
  if (operation.reset) operation.reset();
  context.finish();
  context.take_launches();
  const auto begin = std::chrono::steady_clock::now();
  operation.run();
  context.finish();
  const double wall = seconds_since(begin);
  const std::vector<LaunchTime> launches = context.take_launches();
  for (std::size_t i = 0; i < operation.stages.size(); ++i) {
    const BenchStage& stage = operation.stages[i];
    if (stage.wall) {
      sums[i] += wall;
      continue;
    }
    for (const LaunchTime& launch : launches) {
      if (stage.takes(launch)) sums[i] += launch.seconds;
    }
  }
  return wall;
}

// Google Benchmark says it by another member since 1.8.
template <class Run>
bool was_skipped(const Run& run) {
  if constexpr (requires { run.error_occurred; }) {
    return run.error_occurred;
  } else {
    return static_cast<bool>(run.skipped);
  }
}

// Keeps the samples and prints nothing: the report is made later and elsewhere.
class Collector : public benchmark::BenchmarkReporter {
 public:
  Collector(const std::vector<BenchOperation>& operations) {
    for (const BenchOperation& operation : operations)
      samples.emplace_back(operation.stages.size());
  }
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>& runs) override {
    for (const Run& run : runs) {
      if (run.run_type != Run::RT_Iteration || was_skipped(run)) continue;
      std::vector<StageSamples>& stages = samples.at(std::stoul(run.run_name.function_name));
      for (std::size_t i = 0; i < stages.size(); ++i) {
        stages[i].seconds.push_back(run.counters.at(counter_name(i)).value);
        stages[i].wall.push_back(run.counters.at(kWall).value);
      }
    }
  }

  std::vector<std::vector<StageSamples>> samples;
};

}  // namespace

bool BenchStage::takes(const LaunchTime& launch) const {
  const std::string name = launch.program + ":" + launch.kernel;
  return launches.empty() ||
         std::any_of(launches.begin(), launches.end(),
                     [&](const std::string& start) { return name.starts_with(start); });
}

std::vector<std::vector<StageSamples>> run_operations(Context& context,
                                                      const std::vector<BenchOperation>& operations,
                                                      int repeat,
                                                      double min_seconds,
                                                      const std::function<bool()>& out_of_time,
                                                      bool keep_failures) {
  std::exception_ptr failure;
  std::size_t failed = 0;  // the operation that did
  std::vector<std::string> lacking(operations.size());
  std::vector<bool> warm(operations.size(), false);
  for (std::size_t n = 0; n < operations.size(); ++n) {
    const auto body = [&, n](benchmark::State& state) {
      const BenchOperation& operation = operations[n];
      std::vector<double> sums(operation.stages.size());
      double walls = 0;
      try {
        if (failure) {
          state.SkipWithError("an earlier operation failed");
          return;
        }
        if (out_of_time && out_of_time()) {
          state.SkipWithError("out of time");
          return;
        }
        if (!lacking[n].empty()) {
          state.SkipWithError("the device does not have it");
          return;
        }
        if (!warm[n]) {
          try {
            if (operation.prepare) operation.prepare();
          } catch (const DeviceError& error) {
            if (!operation.optional) throw;
            lacking[n] = error.what();
            state.SkipWithError("the device does not have it");
            return;
          }
          run_once(context, operation, sums);
          context.finish_builds();  // compilers would slow down what is timed
          sums.assign(sums.size(), 0.0);
          warm[n] = true;
        }
        while (state.KeepRunning()) {
          const double wall = run_once(context, operation, sums);
          walls += wall;
          state.SetIterationTime(wall);
        }
      } catch (...) {
        // The harness is no place to throw through.
        failure = std::current_exception();
        failed = n;
        state.SkipWithError("failed");
        return;
      }
      using benchmark::Counter;
      for (std::size_t i = 0; i < sums.size(); ++i) {
        state.counters[counter_name(i)] = Counter(sums[i], Counter::kAvgIterations);
      }
      state.counters[kWall] = Counter(walls, Counter::kAvgIterations);
    };
    benchmark::RegisterBenchmark(std::to_string(n).c_str(), body)
        ->UseManualTime()
        ->MinTime(min_seconds)
        ->Repetitions(repeat);
  }
  Collector collector(operations);
  benchmark::RunSpecifiedBenchmarks(&collector, "all");
  benchmark::ClearRegisteredBenchmarks();
  KeptFailure kept;
  if (failure && keep_failures) {
    kept = failure_of([&] { std::rethrow_exception(failure); });
  } else if (failure) {
    std::rethrow_exception(failure);
  }
  for (std::size_t n = 0; n < operations.size(); ++n) {
    for (StageSamples& stage : collector.samples[n]) {
      stage.lacking = lacking[n];
      if (n == failed) stage.failure = kept;
    }
  }
  return collector.samples;
}

}  // namespace raysplats
