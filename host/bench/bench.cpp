// SPDX-License-Identifier: Apache-2.0
#include "bench/bench.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <map>
#include <regex>

#include "bench/ceilings.hpp"
#include "bench/operation.hpp"
#include "bench/scene_bench.hpp"
#include "core/trace_rows.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"

namespace raysplats {
namespace {

using IdFilter = std::function<bool(const std::string&)>;

IdFilter id_filter(const std::string& expression) {
  if (expression.empty()) return [](const std::string&) { return true; };
  try {
    const std::regex pattern(expression);
    return [pattern](const std::string& id) { return std::regex_search(id, pattern); };
  } catch (const std::regex_error& error) {
    throw UsageError(
        fmt::format("--filter '{}' is no regular expression ({})", expression, error.what()));
  }
}

std::string id_of(const std::string& row, const std::string& scene, std::size_t size) {
  return fmt::format("{}/{}/{}", row, scene, size);
}

struct BenchCase {
  std::string scene;
  std::size_t size;
};

std::vector<BenchCase> cases_of(const BenchOptions& options, const BenchModel* model) {
  if (model != nullptr) return {{model->name, model->gaussians.size()}};
  std::vector<BenchCase> out;
  for (const std::string& scene : options.scenes) {
    for (const std::size_t size : options.sizes) out.push_back({scene, size});
  }
  return out;
}

// Without the stages that the filter leaves out, and the operations that have none left.
std::vector<BenchOperation> selected(std::vector<BenchOperation> operations,
                                     const IdFilter& keep,
                                     const std::string& scene,
                                     std::size_t size) {
  std::vector<BenchOperation> out;
  for (BenchOperation& operation : operations) {
    std::erase_if(operation.stages,
                  [&](const BenchStage& stage) { return !keep(id_of(stage.name, scene, size)); });
    if (!operation.stages.empty()) out.push_back(std::move(operation));
  }
  return out;
}

BenchRow row_of(const BenchStage& stage,
                const StageSamples& samples,
                const std::string& scene,
                std::size_t size) {
  BenchRow row;
  row.name = stage.name;
  row.scene = scene;
  row.size = size;
  row.clock = stage.wall ? "wall" : "device";
  row.seconds = summarize(samples.seconds);
  if (stage.launches.empty()) row.wall = summarize(samples.wall).median;
  row.work = stage.work();
  return row;
}

std::uint64_t peak_process_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
}

std::string tuning_text(const DeviceInfo& device) {
  if (!device.tuning) return "none";
  const DeviceTuning& tuning = *device.tuning;
  return fmt::format("packet shape {}, width {}, tile {}, pending {}, group {}{}",
                     tuning.grouped ? "group" : "vector", tuning.packet_width, tuning.tile,
                     tuning.pending, tuning.group, tuning.bvh ? ", bvh" : "");
}

std::map<std::string, std::string> option_texts(const Context& context,
                                                const BenchOptions& options,
                                                const BenchModel* model) {
  const int width = model != nullptr ? model->camera.width : options.width;
  const int height = model != nullptr ? model->camera.height : options.height;
  return {{"resolution", fmt::format("{}x{}", width, height)},
          {"sh-degree",
           std::to_string(model != nullptr ? model->gaussians.sh_degree : options.sh_degree)},
          {"repeat", std::to_string(options.repeat)},
          {"rays", std::to_string(options.rays)},
          {"triangles", std::to_string(options.triangles)},
          {"packet-shape", packet_shape_name(options.trace.packet_form)},
          {"packet-width", std::to_string(options.trace.packet_width)},
          {"hit-order", options.trace.hit_order == HitOrder::kPeak ? "peak" : "entry"},
          {"quantile", fmt::format("{:g}", options.trace.quantile)},
          {"min-transmittance", fmt::format("{:g}", options.trace.min_transmittance)},
          {"max-hits", std::to_string(options.trace.max_hits)},
          {"adaptive-radius", options.trace.adaptive_radius ? "on" : "off"},
          {"tuning", tuning_text(context.device())},
          {"memory-budget", fmt::format("{} MiB", options.trace.memory_budget >> 20)}};
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
  const auto samples = run_operations(context, operations, options.repeat, options.min_seconds);
  for (std::size_t i = 0; i < operations.size(); ++i) {
    for (std::size_t k = 0; k < operations[i].stages.size(); ++k) {
      report.rows.push_back(row_of(operations[i].stages[k], samples[i][k], model.name, size));
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
      {"light-mesh-small", "rays", "with the small body, diffuse, and no lights"},
      {"light-mesh-large", "rays", "with the large body, diffuse, and no lights"},
      {"light-mirror", "rays", "with the small body as a mirror: mirrored rays too"},
      {"light-glass", "rays", "with the small body of glass: all its rays too"},
      {"light-shadows", "rays", "with the small body and a light: shadow rays of both too"}};
  return rows;
}

std::vector<std::string> bench_ids(const BenchOptions& options, const BenchModel* model) {
  const IdFilter keep = id_filter(options.filter);
  std::vector<std::string> ids;
  for (const auto& [scene, size] : cases_of(options, model)) {
    for (const BenchRowInfo& row : bench_rows()) {
      const std::string id = id_of(row.name, scene, size);
      if (keep(id)) ids.push_back(id);
    }
  }
  return ids;
}

BenchReport run_bench(Context& context, const BenchOptions& options, const BenchModel* model) {
  if (bench_ids(options, model).empty()) {
    throw UsageError(fmt::format("--filter '{}' leaves no row: 'raysplats bench --list' shows all",
                                 options.filter));
  }
  const IdFilter keep = id_filter(options.filter);
  BenchReport report;
  report.version = RAYSPLATS_VERSION;
  report.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::now()));
  report.device = context.device().name;
  report.driver = context.device().driver_version;
  report.platform = context.device().platform;
  report.compute_units = context.device().compute_units;
  report.options = option_texts(context, options, model);
  report.ceilings.fma_flops_per_second = measure_fma_rate(context);
  if (model != nullptr) {
    spdlog::info("{}: {} Gaussians", model->name, model->gaussians.size());
    measure(context, *model, options, keep, report);
  } else {
    for (const BenchCase& one : cases_of(options, nullptr)) {
      const bool wanted = std::any_of(
          bench_rows().begin(), bench_rows().end(),
          [&](const BenchRowInfo& row) { return keep(id_of(row.name, one.scene, one.size)); });
      if (!wanted) continue;
      spdlog::info("{}: {} Gaussians", one.scene, one.size);
      const BenchModel generated{one.scene,
                                 bench_scene(one.scene, one.size, options.seed, options.sh_degree),
                                 bench_camera(options.width, options.height), true};
      measure(context, generated, options, keep, report);
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
