// SPDX-License-Identifier: Apache-2.0
#include "bench/bench.hpp"

#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>

#include "bench/bench_cases.hpp"
#include "bench/ceilings.hpp"
#include "bench/operation.hpp"
#include "bench/scene_bench.hpp"

namespace raysplats {
namespace {

constexpr const char* kNoTime = "it would not have ended in time";

std::uint64_t peak_process_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

void measure(Context& context,
             const BenchModel& model,
             const BenchOptions& options,
             const IdFilter& keep,
             BenchReport& report) {
  const std::size_t size = model.gaussians.size();
  SceneBench bench(context, model, options);
  const std::vector<BenchOperation> operations =
      selected(bench.operations(), keep, model.name, size);
  if (operations.empty()) return;
  const auto out_of_time = [&] {
    return options.deadline && std::chrono::steady_clock::now() >= *options.deadline;
  };
  const auto samples =
      run_operations(context, operations, options.repeat, options.min_seconds, out_of_time);
  for (std::size_t i = 0; i < operations.size(); ++i) {
    for (std::size_t k = 0; k < operations[i].stages.size(); ++k) {
      const BenchStage& stage = operations[i].stages[k];
      if (samples[i][k].seconds.empty()) {
        const std::string& lacking = samples[i][k].lacking;
        report.left_out.push_back(
            {id_of(stage.name, model.name, size), lacking.empty() ? kNoTime : lacking});
      } else {
        report.rows.push_back(row_of(stage, samples[i][k], model.name, size));
      }
    }
  }
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
  report.ceilings.fma_flops_per_second = measure_fma_rate(context);
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
  report.ceilings.copy_bytes_per_second = measure_copy_bandwidth(context);
  report.ceilings.fma_flops_per_second =
      std::max(report.ceilings.fma_flops_per_second, measure_fma_rate(context));
  return report;
}

}  // namespace raysplats
