// SPDX-License-Identifier: Apache-2.0
#include "bench/bench_cases.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <chrono>
#include <regex>

#include "device/tuning.hpp"
#include "raysplats/error.hpp"
#include "scene/options/trace_option_table.hpp"
#include "synth/bench_scenes.hpp"
#include "trace/memory_shares.hpp"

namespace raysplats {
namespace {

std::vector<BenchCase> cases_of(const BenchOptions& options, const BenchModel* model) {
  if (model != nullptr) return {{model->name, model->gaussians.size()}};
  std::vector<BenchCase> out;
  for (const std::string& scene : options.scenes) {
    for (const std::size_t size : options.sizes) out.push_back({scene, size});
  }
  return out;
}

std::string tuning_text(const DeviceInfo& device) {
  if (!device.tuning) return "none";
  const DeviceTuning& tuning = *device.tuning;
  return fmt::format("packet shape {}, width {}, tile {}, pending {}, group {}{}",
                     packet_shape_of(tuning), tuning.packet_width, tuning.tile, tuning.pending,
                     tuning.group, tuning.bvh ? ", bvh" : "");
}

// Of a model's numbers, whatever file they are read from.
std::string fingerprint(const Gaussians& model) {
  XXH64_hash_t hash = 0;
  for (const std::vector<float>* values :
       {&model.means, &model.quaternions, &model.log_scales, &model.opacities, &model.sh})
    hash = XXH64(values->data(), values->size() * sizeof(float), hash);
  return fmt::format("{:016x}", hash);
}

std::map<std::string, std::string> option_texts(const Context& context,
                                                const BenchOptions& options,
                                                const BenchModel* model) {
  const int width = model != nullptr ? model->camera.width : options.width;
  const int height = model != nullptr ? model->camera.height : options.height;
  std::map<std::string, std::string> out{
      {"resolution", fmt::format("{}x{}", width, height)},
      {"sh-degree",
       std::to_string(model != nullptr ? model->gaussians.sh_degree : options.sh_degree)},
      {"repeat", std::to_string(options.repeat)},
      {"rays", std::to_string(options.rays)},
      {"triangles", std::to_string(options.triangles)},
      {"packet-shape", packet_shape_name(options.trace.packet_shape)},
      {"packet-width", std::to_string(options.trace.packet_width)},
      {"hit-order", hit_order_name(options.trace.hit_order)},
      {"quantile", fmt::format("{:g}", options.trace.quantile)},
      {"min-transmittance", fmt::format("{:g}", options.trace.min_transmittance)},
      {"max-hits", std::to_string(options.trace.max_hits)},
      {"adaptive-radius", options.trace.adaptive_radius ? "on" : "off"},
      {"near", fmt::format("{:g}", options.trace.near_depth)},
      {"view-footprint", fmt::format("{:g}", options.trace.view_footprint)},
      {"launch-budget-ms", fmt::format("{:g}", options.trace.launch_budget_ms)},
      {"tuning", tuning_text(context.device())},
      {"memory-budget",
       fmt::format("{} MiB", MemoryShares(options.trace, context.device()).all() >> 20)}};
  if (model != nullptr) {
    out["model"] = fingerprint(model->gaussians);
    out["view"] = model->camera.name;
  }
  return out;
}

}  // namespace

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

void require_rows(const BenchOptions& options, const BenchModel* model) {
  if (!bench_ids(options, model).empty()) return;
  throw UsageError(fmt::format("--filter '{}' leaves no row: 'raysplats bench --list' shows all",
                               options.filter));
}

std::vector<BenchCase> wanted_cases(const BenchOptions& options) {
  require_rows(options, nullptr);
  const IdFilter keep = id_filter(options.filter);
  std::vector<BenchCase> cases = cases_of(options, nullptr);
  std::erase_if(cases, [&](const BenchCase& one) {
    return std::none_of(bench_rows().begin(), bench_rows().end(), [&](const BenchRowInfo& row) {
      return keep(id_of(row.name, one.scene, one.size));
    });
  });
  return cases;
}

BenchModel generated(const BenchCase& one, const BenchOptions& options) {
  return {one.scene, bench_scene(one.scene, one.size, options.seed, options.sh_degree),
          bench_camera(options.width, options.height), true};
}

BenchReport bench_header(const Context& context,
                         const BenchOptions& options,
                         const BenchModel* model) {
  BenchReport report;
  report.version = RAYSPLATS_VERSION;
  report.date = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::chrono::system_clock::now()));
  report.device = context.device().name;
  report.driver = context.device().driver_version;
  report.platform = context.device().platform;
  report.compute_units = context.device().compute_units;
  report.options = option_texts(context, options, model);
  return report;
}

}  // namespace raysplats
