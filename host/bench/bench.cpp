// SPDX-License-Identifier: Apache-2.0
#include "bench/bench.hpp"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstddef>
#include <functional>
#include <optional>

#include "bench/bench_cases.hpp"
#include "bench/ceilings.hpp"
#include "bench/kept_failure.hpp"
#include "bench/operation.hpp"
#include "bench/scene_bench.hpp"

namespace raysplats {
namespace {

constexpr const char* kNoTime = "it would not have ended in time";
constexpr const char* kLimits = "the device's limits";

std::uint64_t peak_process_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

// Does `work`; where failures are kept, one is the reason why `id` is left out.
void keep_going(const BenchOptions& options,
                const std::string& id,
                BenchReport& report,
                const std::function<void()>& work) {
  if (!options.keep_failures) return work();
  const std::string failure = failure_of(work).reason;
  if (!failure.empty()) report.left_out.push_back({id, failure, true});
}

void add_row(const BenchStage& stage,
             const StageSamples& samples,
             const BenchModel& model,
             const BenchOptions& options,
             BenchReport& report) {
  const std::string id = id_of(stage.name, model.name, model.gaussians.size());
  if (!samples.failure.reason.empty()) {
    report.left_out.push_back({id, samples.failure.reason, true});
  } else if (samples.seconds.empty()) {
    report.left_out.push_back({id, samples.lacking.empty() ? kNoTime : samples.lacking});
  } else {
    keep_going(options, id, report, [&] {
      report.rows.push_back(row_of(stage, samples, model.name, model.gaussians.size()));
    });
  }
}

// Measures the operations from number `first` on. Where one fails and that is kept, the number of
// the next one, or its own where memory did not suffice beside what those before it hold.
std::optional<std::size_t> measure_from(std::size_t first,
                                        Context& context,
                                        const BenchModel& model,
                                        const BenchOptions& options,
                                        const IdFilter& keep,
                                        BenchReport& report) {
  SceneBench bench(context, model, options);
  std::vector<BenchOperation> operations =
      selected(bench.operations(), keep, model.name, model.gaussians.size());
  operations.erase(operations.begin(), operations.begin() + static_cast<std::ptrdiff_t>(first));
  if (operations.empty()) return std::nullopt;
  const auto out_of_time = [&] {
    return options.deadline && std::chrono::steady_clock::now() >= *options.deadline;
  };
  const auto samples = run_operations(context, operations, options.repeat, options.min_seconds,
                                      out_of_time, options.keep_failures);
  for (std::size_t i = 0; i < operations.size(); ++i) {
    const KeptFailure& failure = samples[i].front().failure;
    // Alone it may fit.
    if (failure.of_memory && i > 0) return first + i;
    for (std::size_t k = 0; k < operations[i].stages.size(); ++k)
      add_row(operations[i].stages[k], samples[i][k], model, options, report);
    if (!failure.reason.empty()) return first + i + 1;
  }
  return std::nullopt;
}

// What has failed may have left half of what the others share: they get a bench of their own.
void measure(Context& context,
             const BenchModel& model,
             const BenchOptions& options,
             const IdFilter& keep,
             BenchReport& report) {
  std::optional<std::size_t> next = 0;
  while (next) next = measure_from(*next, context, model, options, keep, report);
}

}  // namespace

const std::vector<BenchRowInfo>& bench_rows() {
  static const std::vector<BenchRowInfo> rows{
      {"sort", "pairs", "radix sort of random 32-bit keys with values"},
      {"bounds", "boxes", "boxes of the Gaussians"},
      {"order", "boxes", "codes along the curve, sort, groups, within a build"},
      {"nodes", "boxes", "blocks and nodes with their boxes, within a build"},
      {"build", "boxes", "LBVH of the Gaussians, all that rays need: bounds, order, nodes"},
      {"refit", "boxes", "the same LBVH for Gaussians that moved: bounds, nodes"},
      {"prepare-view", "Gaussians", "lines and outlines of all Gaussians for a camera"},
      {"tile-lists", "candidates", "candidates of every tile, sorted"},
      {"forward", "rays", "camera rays through their lists"},
      {"view", "rays", "one image: prepare-view, tile-lists, forward"},
      {"view-bvh", "rays", "the same image, every ray through the LBVH"},
      {"backward", "rays", "hit streams to gradient lines, clearing them included"},
      {"finalize", "Gaussians", "gradient lines to gradients of parameters"},
      {"loss-value", "pixels", "L1 and SSIM"},
      {"loss-gradient", "pixels", "their gradient"},
      {"adam", "Gaussians", "one step of the optimiser"},
      {"mean", "Gaussians", "one sample of the mean of the last steps"},
      {"density-sums", "Gaussians", "statistics of density control"},
      {"densify", "Gaussians", "density control of every tenth Gaussian, planned on the host"},
      {"iteration", "iterations", "training: bounds, forward, loss, backward, sums, Adam"},
      {"iteration-bvh", "iterations", "the same, every ray through the LBVH, refit included"},
      {"rays", "rays", "incoherent rays between random points"},
      {"surfaces-small", "rays", "camera rays to a closed body of a tenth of --triangles"},
      {"surfaces-large", "rays", "camera rays to a closed body of --triangles"},
      {"surfaces-random", "rays", "incoherent rays to the large body"},
      {"light", "rays", "one image by the tracer of light, without a mesh"},
      {"light-samples", "rays", "the same with 4 samples a pixel"},
      {"light-mesh-small", "rays", "with the small body, diffuse, and no lights"},
      {"light-mesh-large", "rays", "with the large body, diffuse, and no lights"},
      {"light-mirror", "rays", "with the small body as a mirror: mirrored rays too"},
      {"light-glass", "rays", "with the small body of glass: all its rays too"},
      {"light-shadows", "rays", "with the small body and a light: shadow rays of both too"},
      {"forward-vector", "rays", "camera rays in packets that are vectors, hits kept"},
      {"backward-vector", "rays", "their hit streams to gradient lines"},
      {"forward-group", "rays", "the same in packets that are work-groups"},
      {"backward-group", "rays", "their hit streams to gradient lines"},
      {"forward-subgroup", "rays", "the same in packets that are subgroups, where there are any"},
      {"backward-subgroup", "rays", "their hit streams to gradient lines"}};
  return rows;
}

BenchReport run_bench(Context& context, const BenchOptions& options, const BenchModel* model) {
  require_rows(options, model);
  const IdFilter keep = id_filter(options.filter);
  BenchReport report = bench_header(context, options, model);
  keep_going(options, kLimits, report,
             [&] { report.ceilings.fma_flops_per_second = measure_fma_rate(context); });
  if (model != nullptr) {
    spdlog::info("{}: {} Gaussians", model->name, model->gaussians.size());
    measure(context, *model, options, keep, report);
  } else {
    for (const BenchCase& one : wanted_cases(options)) {
      spdlog::info("{}: {} Gaussians", one.scene, one.size);
      measure(context, generated(one, options), options, keep, report);
    }
  }
  report.peak_process_bytes = peak_process_bytes();
  report.peak_device_bytes = context.peak_allocated_bytes();
  // After the rows, because its buffers would count as theirs.
  keep_going(options, kLimits, report, [&] {
    report.ceilings.copy_bytes_per_second = measure_copy_bandwidth(context);
    report.ceilings.fma_flops_per_second =
        std::max(report.ceilings.fma_flops_per_second, measure_fma_rate(context));
  });
  return report;
}

}  // namespace raysplats
