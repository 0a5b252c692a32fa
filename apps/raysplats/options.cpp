// SPDX-License-Identifier: Apache-2.0
#include "options.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <filesystem>
#include <functional>
#include <system_error>
#include <utility>

#include "logging.hpp"
#include "scene/options/option_flags.hpp"
#include "util/number_text.hpp"
#include "util/progress.hpp"
#include "validators.hpp"

namespace raysplats::cli {

void add_global_options(CLI::App& app, GlobalOptions& options) {
  app.add_option("--log-level", options.log_level,
                 "Least severe log lines to show: debug, info, warn, error, off")
      ->check(one_of({"debug", "info", "warn", "error", "off"}))
      ->capture_default_str()
      ->type_name("LEVEL");
  app.add_flag("-q,--quiet", options.quiet, "Show errors only: no log lines, no progress");
}

void add_device_flags(CLI::App& app, DeviceFlags& flags) {
  app.add_option("--device", flags.device,
                 "Index or part of the name of a device ('raysplats devices' lists them); train, "
                 "render and eval share their work among several, as in 0,1")
      ->type_name("DEVICE");
  app.add_flag("--profile", flags.profile, "Print the device time per kernel");
  app.add_flag("--no-kernel-cache", flags.no_kernel_cache, "Compile every kernel again");
}

namespace {

// Shows the compiling of kernels, whose number nobody knows before: a bar without an end.
std::function<void(std::size_t, const std::string&)> show_compiling() {
  if (LogSilence::holds() || !spdlog::should_log(spdlog::level::info)) return {};
  const auto bar = std::make_shared<Progress>("compiling kernels", Progress::kUnknown);
  return [bar](std::size_t number, const std::string& program) {
    if (program.empty()) {
      bar->suspend();
      return;
    }
    bar->resume();
    bar->update(static_cast<std::int64_t>(number), program);
  };
}

// Empty where the system does not tell.
std::filesystem::path own_program() {
  std::error_code error;
  return std::filesystem::read_symlink("/proc/self/exe", error);
}

}  // namespace

std::unique_ptr<Context> open_context(const DeviceFlags& flags) {
  return open_context(flags, select_device(flags.device));
}

std::unique_ptr<Context> open_context(const DeviceFlags& flags, const DeviceInfo& device) {
  ContextOptions options;
  options.compiling = show_compiling();
  options.compiler = own_program();
  options.profile = flags.profile;
  options.kernel_cache = !flags.no_kernel_cache;
  spdlog::info("device {}: {} ({})", device.index, device.name, device.platform);
  return std::make_unique<Context>(device, options);
}

namespace {

// An option by its row of the table, kept for what it goes over.
template <class Options, std::vector<OptionRow> (*rows_of)(Options&)>
CLI::Option* add_setting(CLI::App& app,
                         GivenOptions<Options, rows_of>& settings,
                         const std::string& name,
                         const std::string& names = {}) {
  Options defaults;
  const std::vector<OptionRow> rows = rows_of(defaults);
  return add_row(
      app, *find_row(rows, name),
      [&settings, name](const std::vector<std::string>& values) { settings.set(name, values); },
      names);
}

}  // namespace

void add_trace_flags(CLI::App& app, TraceSettings& settings) {
  add_setting(app, settings, "quantile", "--q");
  for (const char* name :
       {"min-transmittance", "max-hits", "hit-order", "adaptive-radius", "near", "view-footprint"})
    add_setting(app, settings, name);
  add_setting(app, settings, "background")->type_name("R,G,B");
  for (const char* name : {"packet-shape", "packet-width", "memory-budget", "launch-budget-ms"})
    add_setting(app, settings, name);
}

void add_traversal_flag(CLI::App& app, TraceSettings& settings) {
  add_setting(app, settings, "traversal");
}

void add_render_flags(CLI::App& app, GivenRenderSettings& settings, const std::string& group) {
  for (const char* name : {"samples", "max-bounces", "seed"})
    add_setting(app, settings, name)->group(group);
}

std::string with_compiling(const std::string& text, double seconds) {
  if (seconds < 0.1) return text;
  return fmt::format("{}, besides {:.1f} s of compiling kernels", text, seconds);
}

void warn_of_capped_rays(std::uint64_t capped, std::uint64_t rays, const TraceOptions& options) {
  if (capped == 0) return;
  spdlog::warn("{} of {} rays stopped at --max-hits {}: raise it for the rest of their colour",
               capped, rays, options.max_hits);
}

void tell_of_ended_paths(std::uint64_t ended, std::uint64_t camera_rays, int max_bounces) {
  if (ended == 0) return;
  if (100 * ended > camera_rays) {
    spdlog::warn("{} of {} ended after --max-bounces {}: raise it for the rest of their light",
                 counted(static_cast<double>(ended), "path"),
                 counted(static_cast<double>(camera_rays), "camera ray"), max_bounces);
  } else {
    spdlog::info("{} ended after --max-bounces {}", counted(static_cast<double>(ended), "path"),
                 max_bounces);
  }
}

CLI::Option* add_data_flags(CLI::App& app, DataFlags& flags, const std::string& split) {
  const std::string group = "Data set";
  CLI::Option* data = app.add_option("-d,--data", flags.data,
                                     "Data set (as of train) whose cameras to use; what is not "
                                     "said of it is as in the run of the model, else the default");
  data->group(group)->type_name("DATASET");
  app.add_option("--split", flags.split, split)
      ->group(group)
      ->check(one_of({"test", "train", "all"}));
  for (const char* name : {"downscale", "test-every", "test-list", "undistort", "masks", "alpha",
                           "borders", "ignore-areas"})
    add_setting(app, flags.settings, name)->group(group);
  return data;
}

void add_photo_flags(CLI::App& app, DataSettings& settings) {
  for (const char* name : kPhotoFlags) add_setting(app, settings, name);
}

Split DataFlags::chosen_split() const {
  const std::string name = split.value_or("test");
  if (name == "train") return Split::kTrain;
  return name == "all" ? Split::kAll : Split::kTest;
}

DatasetOptions DataFlags::over(DatasetOptions run, bool all) const {
  if (all) run.test_list.reset();
  return settings.over(std::move(run));
}

void DataFlags::check_used(bool orbit) const {
  const bool chosen = split || settings.has("test-every") || settings.has("test-list");
  const bool about_photos = settings.has("undistort") || settings.has("masks") ||
                            settings.has("alpha") || settings.has("borders") ||
                            settings.has("ignore-areas");
  if (data.empty() && (chosen || about_photos)) {
    throw UsageError(
        "--split, --test-every, --test-list, --undistort, --masks, --alpha, --borders and "
        "--ignore-areas are about the views of a data set: add --data DATASET");
  }
  if (orbit && chosen) {
    throw UsageError(
        "--split, --test-every and --test-list choose views, but an orbit goes around all of them: "
        "leave them out");
  }
  if (orbit && data.empty() && settings.has("downscale")) {
    throw UsageError(
        "--downscale divides the sizes of a data set's photos, and this orbit has no --data: give "
        "--width and --height");
  }
}

void add_overwrite_flag(CLI::App& app, bool& flag, const std::string& help) {
  app.add_flag("--overwrite", flag, help);
}

DataError no_views(const DataFlags& flags) {
  return DataError(fmt::format("The {} split of {} has no views: choose another --split",
                               flags.split.value_or("test"), flags.data));
}

}  // namespace raysplats::cli
