// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <string>
#include <tuple>

#include "bench/tune.hpp"
#include "commands.hpp"
#include "device/tuning.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "synth/bench_scenes.hpp"
#include "validators.hpp"
#include "value_text.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  TuneOptions tune;
  std::string axes = fmt::format("{}", fmt::join(tune_axes(), ","));
  std::string size = "100k";
  std::string resolution = "512x512";
  bool dry_run = false;
  bool reset = false;
  TraceSettings trace;
  DeviceFlags device;
};

void run(const Options& options) {
  const DeviceInfo device = select_device(options.device.device);
  TuningStore store;
  if (options.reset) {
    if (options.dry_run) throw UsageError("--reset measures nothing: leave out --dry-run");
    if (store.path().empty())
      throw DataError("There is no folder of tunings: set HOME or XDG_CACHE_HOME");
    const std::size_t removed = store.remove(device);
    fmt::print("{} tuning of {} removed from {}\n", removed, device.name, store.path().string());
    return;
  }
  TuneOptions tune = options.tune;
  tune.axes = names_of("--axes", options.axes, tune_axes());
  tune.size = parse_count("--size", options.size);
  std::tie(tune.width, tune.height) = parse_resolution(options.resolution);
  tune.trace = options.trace.over(tune.trace);
  ContextOptions timed;
  timed.profile = timed.keep_launches = true;
  timed.kernel_cache = !options.device.no_kernel_cache;
  timed.tuning = false;
  Context context(device, timed);
  spdlog::info("tuning {} on {} {} Gaussians at {}x{}", device.name, tune.size, tune.scene,
               tune.width, tune.height);
  const TuneResult result = tune_device(context, tune, [](const TuneTrial& trial) {
    if (trial.problem.empty()) {
      spdlog::info("{:<13} {:<66} {:10.3f} ms", trial.axis, describe(trial.tuning),
                   1e3 * trial.seconds);
    } else {
      spdlog::info("{:<13} {:<66} does not run", trial.axis, describe(trial.tuning));
      spdlog::debug("{}", trial.problem);
    }
  });
  fmt::print("default: {}\n", describe(result.start));
  fmt::print("best:    {} ({:.2f} x as fast)\n", describe(result.best), result.speedup);
  if (options.dry_run) return;
  store.store(device, result.best);
  fmt::print("stored in {} for {}, driver {}\n", store.path().string(), device.name,
             device.driver_version);
}

}  // namespace

Command add_tune_command(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("tune", "Search the fastest way to trace on a device and keep it");
  auto options = std::make_shared<Options>();
  command->add_option("--scene", options->tune.scene, "Generated scene to measure on")
      ->check(one_of(bench_scene_names()))
      ->capture_default_str();
  command->add_option("--size", options->size, "Number of Gaussians, for example 100k")
      ->capture_default_str()
      ->type_name("N");
  command->add_option("--resolution", options->resolution, "Pixels")
      ->capture_default_str()
      ->type_name("WxH");
  command->add_option("--repeat", options->tune.repeat, "Repetitions of every candidate")
      ->transform(whole_between(1, 1000))
      ->capture_default_str();
  command->add_option("--axes", options->axes, "What to vary")
      ->capture_default_str()
      ->type_name("NAME,...");
  command->add_flag("--dry-run", options->dry_run, "Only print the result");
  command->add_flag("--reset", options->reset, "Forget what was found for the device instead");
  add_trace_flags(*command, options->trace);
  command->remove_option(command->get_option("--packet-width"));
  command->remove_option(command->get_option("--packet-shape"));
  command->remove_option(command->get_option("--view-footprint"));  // it tunes no picture
  add_device_flags(*command, options->device);
  command->remove_option(command->get_option("--profile"));
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
