// SPDX-License-Identifier: Apache-2.0
#include "bench/forecast.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>

#include "bench/bench_cases.hpp"
#include "bench/ceilings.hpp"
#include "bench/operation.hpp"
#include "bench/processor_time.hpp"
#include "bench/scene_bench.hpp"
#include "raysplats/error.hpp"
#include "util/clock.hpp"

namespace raysplats {
namespace {

constexpr double kLeastSeconds = 2.0;    // that a row is repeated for
constexpr double kSmallStage = 0.1;      // of an operation
constexpr double kShortSeconds = 0.004;  // that may pass without a change of the scheduler
constexpr std::size_t kMebi = std::size_t{1} << 20;
// Sizes between which caches end.
constexpr std::size_t kLevels[] = {32 << 10,   512 << 10,   2 * kMebi,  8 * kMebi,
                                   32 * kMebi, 128 * kMebi, 512 * kMebi};

// What an operation and its stages took by the device's clock, and of it the processors' time.
struct Spent {
  double all = 0;
  double worked = 0;
  std::vector<double> stages;
  std::vector<double> least;
};

void run_once(Context& context, const BenchOperation& operation, Spent& spent) {
  if (operation.reset) operation.reset();
  context.finish();
  context.take_launches();
  const ProcessorTime processors(context);
  operation.run();
  context.finish();
  const std::size_t count = operation.stages.size();
  spent.stages.resize(count, 0.0);
  spent.least.resize(count, std::numeric_limits<double>::infinity());
  std::vector<double> stages(count, 0.0);
  double all = 0;
  for (const LaunchTime& launch : context.take_launches()) {
    all += launch.seconds;
    for (std::size_t k = 0; k < count; ++k)
      if (operation.stages[k].takes(launch)) stages[k] += launch.seconds;
  }
  for (std::size_t k = 0; k < count; ++k) {
    spent.stages[k] += stages[k];
    spent.least[k] = std::min(spent.least[k], stages[k]);
  }
  spent.all += all;
  spent.worked += all * processors.share(all);
}

// Every stage by its part of the time that the processors worked: others may share them, and a
// kernel that waits for a processor is not slow. Of a stage that is a small part of its operation
// nobody knows whether it waited as much as the rest: where it is short its least time counts.
void measure_rows(Context& context,
                  SceneBench& bench,
                  const BenchOptions& options,
                  Forecast& forecast) {
  const std::vector<std::string>& wanted = modelled_rows();
  const IdFilter keep = [&wanted](const std::string& id) {
    return std::find(wanted.begin(), wanted.end(), id.substr(0, id.find('/'))) != wanted.end();
  };
  const auto operations = selected(bench.operations(), keep, forecast.scene, forecast.size);
  for (const BenchOperation& operation : operations) {
    Spent spent;
    operation.prepare();
    run_once(context, operation, spent);
    spent = {};
    int runs = 0;
    const auto begin = std::chrono::steady_clock::now();
    for (; runs < options.repeat || seconds_since(begin) < kLeastSeconds; ++runs)
      run_once(context, operation, spent);
    for (std::size_t k = 0; k < spent.stages.size(); ++k) {
      for (Forecast::Row& row : forecast.rows) {
        if (row.name != operation.stages[k].name) continue;
        const double by_share = spent.stages[k] * spent.worked / (spent.all * runs);
        const bool small = spent.stages[k] < kSmallStage * spent.all && by_share < kShortSeconds;
        row.measured = small ? spent.least[k] : by_share;
      }
    }
  }
}

Forecast forecast_of(Context& context,
                     const BenchOptions& options,
                     const BenchModel& model,
                     const DeviceSpeeds& device) {
  Forecast out;
  out.scene = model.name;
  out.size = model.gaussians.size();
  out.width = model.camera.width;
  out.height = model.camera.height;
  SceneBench bench(context, model, options);
  out.vectors = bench.counts(false);
  out.groups = bench.counts(true);
  for (const std::string& name : modelled_rows()) {
    Forecast::Row row;
    row.name = name;
    row.device = predict(executed_work(name, out.vectors), device);
    out.rows.push_back(row);
  }
  measure_rows(context, bench, options, out);
  out.cards = forecast_cards(out.groups);
  return out;
}

}  // namespace

DeviceSpeeds measure_speeds(Context& context) {
  DeviceSpeeds out;
  out.name = context.device().name;
  out.cpu = context.device().type == DeviceType::kCpu;
  out.vectors = measure_vector_rate(context);
  out.scalars = measure_scalar_rate(context);
  out.slow = measure_slow_rate(context);
  out.shifted = measure_shifted_rate(context);
  out.parked = measure_parked_rate(context);
  out.processors = std::max<double>(1, context.device().compute_units);
  out.late_seconds = measure_late_seconds(context);
  for (const std::size_t bytes : kLevels) {
    out.bandwidth.push_back(
        {static_cast<double>(bytes), measure_copy_bandwidth(context, bytes / 2)});
    out.lines.push_back({static_cast<double>(bytes), measure_line_rate(context, bytes)});
    out.runs.push_back({static_cast<double>(bytes), measure_run_rate(context, bytes)});
    out.chases.push_back({static_cast<double>(bytes), measure_chase_rate(context, bytes)});
    out.tiled.push_back({static_cast<double>(bytes), measure_tile_rate(context, bytes)});
    out.stores.push_back({static_cast<double>(bytes), measure_store_rate(context, bytes)});
  }
  return out;
}

ForecastReport make_forecast(Context& context,
                             const BenchOptions& options,
                             const BenchModel* model) {
  if (context.device().type != DeviceType::kCpu) {
    throw UsageError(
        "--forecast counts with the kernels of a CPU and compares with it: give --device a CPU");
  }
  ForecastReport report;
  report.device = measure_speeds(context);
  if (model != nullptr) {
    report.forecasts.push_back(forecast_of(context, options, *model, report.device));
  } else {
    for (const BenchCase& one : wanted_cases(options))
      report.forecasts.push_back(
          forecast_of(context, options, generated(one, options), report.device));
  }
  return report;
}

std::string forecast_text(const ForecastReport& report) {
  const DeviceSpeeds& d = report.device;
  std::string out = fmt::format(
      "{}: {:.2f} G vector, {:.2f} G scalar instructions/s, {:.2f} G divisions and roots/s,\n"
      "  {:.2f} G vectors/s read at any float, {:.2f} G written nearby,\n"
      "  {:.0f} processors, the others {:.0f} us after the first\n",
      d.name, 1e-9 * d.vectors, 1e-9 * d.scalars, 1e-9 * d.slow, 1e-9 * d.shifted, 1e-9 * d.parked,
      d.processors, 1e6 * d.late_seconds);
  for (std::size_t i = 0; i < d.bandwidth.size(); ++i) {
    out += fmt::format(
        "  up to {:>6.0f} KiB: {:>6.1f} GB/s in order, {:>7.1f} M lines/s at random, {:>6.1f} "
        "chased, {:>7.1f} by tiles\n",
        d.bandwidth[i].bytes / 1024, 1e-9 * d.bandwidth[i].per_second, 1e-6 * d.lines[i].per_second,
        1e-6 * d.chases[i].per_second, 1e-6 * d.tiled[i].per_second);
  }
  for (const Forecast& f : report.forecasts) {
    out += fmt::format("\n{}, {} Gaussians, {}x{}\n", f.scene, f.size, f.width, f.height);
    for (const ExecutedCounts* c : {&f.vectors, &f.groups}) {
      out += fmt::format(
          "{}: of a packet {:.0f} candidates tested, {:.0f} hit by {:.1f} rays each, {:.0f} pairs "
          "of "
          "open rows;\n  of a ray through the tree {:.0f} nodes, {:.0f} blocks, {:.0f} hits\n",
          c->grouped ? "groups of 32 rays" : "vectors of 16 rays", c->tested / c->packets,
          c->opened / c->packets, c->hits / std::max(c->opened, 1.0), c->compared / c->packets,
          c->ray_nodes / c->rays, c->ray_blocks / c->rays, c->ray_hits / c->rays);
    }
    out += fmt::format("{:<15} {:>10} {:>10} {:>16}  {}\n", "on this device", "measured",
                       "model, ms", "measured / model", "bound");
    for (const Forecast::Row& row : f.rows) {
      out += fmt::format("{:<15} {:>10.3f} {:>10.3f} {:>16.2f}  {}\n", row.name, 1e3 * row.measured,
                         1e3 * row.device.seconds, row.measured / row.device.seconds,
                         row.device.bound);
    }
    out += cards_text(f.cards);
  }
  return out;
}

}  // namespace raysplats
