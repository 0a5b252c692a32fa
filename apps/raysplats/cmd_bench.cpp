// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <system_error>
#include <tuple>
#include <utility>

#include "bench/bench.hpp"
#include "bench/compare.hpp"
#include "bench/device_report.hpp"
#include "bench/forecast.hpp"
#include "bench/kernel_folders.hpp"
#include "commands.hpp"
#include "io/dataset/dataset_views.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "report/bench_page.hpp"
#include "run/model_source.hpp"
#include "synth/bench_scenes.hpp"
#include "util/atomic_file.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"
#include "value_text.hpp"

namespace raysplats::cli {
namespace {

constexpr std::size_t kLargeSize = 3'000'000;

struct Options {
  std::string sizes = "10k,100k,1M";
  bool large = false;
  std::string scenes = "random";
  std::string model;
  std::string cameras;
  std::size_t view = 0;
  std::optional<std::string> resolution;
  bool list = false;
  std::string report;
  bool forecast = false;
  std::string kernels;
  std::string against;
  std::string json;
  std::string csv;
  std::string html;
  bool overwrite = false;
  BenchOptions bench;
  TraceSettings trace;
  DeviceFlags device;
};

struct CompareOptions {
  std::string before;
  std::string after;
};

// The camera at another size, with the same field of view across.
Camera resized(Camera camera, int width, int height) {
  const double x = static_cast<double>(width) / camera.width;
  const double y = static_cast<double>(height) / camera.height;
  camera.fx *= x;
  camera.fy *= x;
  camera.cx *= x;
  camera.cy *= y;
  camera.width = width;
  camera.height = height;
  return camera;
}

std::vector<Camera> read_views(const std::string& path) {
  if (!is_folder(path)) return read_cameras(path);
  return cameras_of(load_dataset(path), Split::kAll);
}

// Most models are called point_cloud; their folders tell them apart.
std::string name_of(const std::filesystem::path& model) {
  std::filesystem::path path = std::filesystem::absolute(model).lexically_normal();
  if (!path.has_filename()) path = path.parent_path();
  if (path.stem() == "point_cloud" && path.extension() == ".ply") {
    return path.parent_path().filename().string();
  }
  return path.extension() == ".ply" ? path.stem().string() : path.filename().string();
}

BenchModel load_model(const Options& options, const ModelSource& source) {
  if (options.cameras.empty()) {
    throw UsageError("--model needs --cameras: a transforms.json or the folder of a data set");
  }
  const std::vector<Camera> cameras = read_views(options.cameras);
  if (options.view >= cameras.size()) {
    throw UsageError(fmt::format("--view {} is beyond the {} views of {}", options.view,
                                 cameras.size(), options.cameras));
  }
  BenchModel model{name_of(options.model), read_model(source.file), cameras[options.view], false};
  if (options.resolution) {
    const auto [width, height] = parse_resolution(*options.resolution);
    model.camera = resized(model.camera, width, height);
  }
  return model;
}

/// Options that say nothing about what is measured are mistakes.
void check_used(const CLI::App& command, const Options& options) {
  const bool model = !options.model.empty();
  for (const char* name : {"--sizes", "--large", "--scene", "--sh-degree"}) {
    if (model && command.get_option(name)->count() > 0) {
      throw UsageError(
          fmt::format("{} is about generated scenes: leave it out with --model", name));
    }
  }
  if (!model && command.get_option("--view")->count() > 0) {
    throw UsageError("--view goes with --model");
  }
}

// Reports and comparisons of kernels are about generated scenes and have a form of their own.
void check_alone(const CLI::App& command, const Options& options) {
  if (options.kernels.empty() != options.against.empty()) {
    throw UsageError(
        "--kernels and --against name the two folders of kernels to compare: give both");
  }
  const auto refuse = [&](const char* whole, std::initializer_list<const char*> names) {
    for (const char* name : names) {
      if (command.get_option(name)->count() > 0)
        throw UsageError(fmt::format("{} does not go with {}: leave it out", name, whole));
    }
  };
  // A forecast is text alone.
  if (options.forecast) refuse("--forecast", {"--json", "--csv", "--html", "--profile"});
  const char* whole = !options.report.empty() ? "--report" : "--kernels";
  if (options.report.empty() && options.kernels.empty()) return;
  if (!options.report.empty() && !options.kernels.empty()) {
    throw UsageError("--report measures the kernels that are built in: leave out --kernels");
  }
  refuse(whole, {"--model", "--cameras", "--json", "--csv", "--html", "--list", "--profile"});
}

/// Refuses results without a place to go, which would be lost: before anything is measured.
void check_results(const Options& options, const std::filesystem::path& model) {
  std::map<std::filesystem::path, const char*> taken;
  for (const auto& [name, file] : {std::pair{"--json", &options.json},
                                   {"--csv", &options.csv},
                                   {"--html", &options.html},
                                   {"--report", &options.report}}) {
    if (file->empty()) continue;
    check_output_file(*file, options.overwrite, {model});
    std::error_code error;
    const std::filesystem::path place =
        std::filesystem::weakly_canonical(std::filesystem::absolute(*file, error), error);
    const auto [other, added] = taken.emplace(place, name);
    if (!added)
      throw UsageError(fmt::format("{} and {} both name {}: give each a file of its own",
                                   other->second, name, *file));
    const AtomicFile probe(*file);
  }
}

/// Throws where the device fails at anything; the file is there already.
void check_report(const DeviceReport& report, const std::string& file) {
  std::vector<std::string> troubles;
  if (!report.passed()) troubles.emplace_back("does not compute what it should");
  if (report.failed > 0) {
    troubles.push_back(fmt::format("fails in {} of what is measured, named under left_out",
                                   counted(static_cast<double>(report.failed), "part")));
  }
  if (troubles.empty()) return;
  throw DeviceError(fmt::format("The device {} {}: please send us {}, and see docs/gpu.md",
                                report.device.name, fmt::join(troubles, " and "), file));
}

/// Throws where a row failed; what could be measured is told already.
void check_rows(const BenchReport& report) {
  const auto failed = std::count_if(report.left_out.begin(), report.left_out.end(),
                                    [](const BenchReport::LeftOut& row) { return row.failed; });
  if (failed == 0) return;
  throw DeviceError(fmt::format("The device {} fails in {} of what is measured, named as left out",
                                report.device, counted(static_cast<double>(failed), "part")));
}

void run(const CLI::App& command, const Options& options) {
  check_used(command, options);
  check_alone(command, options);
  BenchOptions bench = options.bench;
  bench.sizes.clear();
  for (const std::string& text : parts_of(options.sizes))
    bench.sizes.push_back(parse_count("--sizes", text));
  if (options.large) bench.sizes.push_back(kLargeSize);
  if (bench.sizes.empty()) throw UsageError("--sizes names nothing, as in 10k,100k");
  bench.scenes = options.scenes == "all" ? bench_scene_names()
                                         : names_of("--scene", options.scenes, bench_scene_names());
  if (options.resolution) {
    std::tie(bench.width, bench.height) = parse_resolution(*options.resolution);
  }
  std::optional<BenchModel> model;
  std::filesystem::path model_file;
  if (!options.model.empty()) {
    const ModelSource source = find_model(options.model);
    model_file = source.file;
    model = load_model(options, source);
    bench.trace = trace_options(source);
  } else if (!options.cameras.empty()) {
    throw UsageError("--cameras goes with --model");
  }
  bench.trace = options.trace.over(bench.trace);
  const BenchModel* chosen = model ? &*model : nullptr;
  if (options.forecast && (!options.report.empty() || !options.kernels.empty())) {
    throw UsageError("--forecast goes with neither --report nor --kernels: run them one by one");
  }
  if (options.list) {
    for (const std::string& id : bench_ids(bench, chosen)) fmt::print("{}\n", id);
    return;
  }
  check_results(options, model_file);
  ContextOptions timed;
  timed.profile = timed.keep_launches = true;
  timed.kernel_cache = !options.device.no_kernel_cache;
  const DeviceInfo device = select_device(options.device.device);
  if (!options.kernels.empty()) {
    fmt::print("{}", kernel_comparison_table(
                         compare_kernels(device, timed, options.kernels, options.against, bench)));
    return;
  }
  Context context(device, timed);
  if (!options.report.empty()) {
    const DeviceReport report = make_device_report(context, bench);
    // First, so that no trouble with standard output loses it.
    write_text_file(options.report, device_report_json(report));
    fmt::print("{}", device_report_text(report));
    check_report(report, options.report);
    return;
  }
  if (options.forecast) {
    fmt::print("{}", forecast_text(make_forecast(context, bench, chosen)));
    return;
  }
  bench.keep_failures = true;
  const BenchReport report = run_bench(context, bench, chosen);
  // First, so that no trouble with standard output loses it.
  if (!options.json.empty()) write_text_file(options.json, bench_json(report));
  if (!options.csv.empty()) write_text_file(options.csv, bench_csv(report));
  if (!options.html.empty()) write_text_file(options.html, bench_page(report));
  fmt::print("{}", bench_table(report));
  if (options.device.profile) fmt::print("{}", context.profile_table());
  check_rows(report);
}

void compare(const CompareOptions& options) {
  const BenchReport before = read_bench_report(options.before);
  const BenchReport after = read_bench_report(options.after);
  fmt::print("{}", comparison_table(compare_reports(before, after)));
}

/// Options that choose which rows are measured, and on what.
void add_row_options(CLI::App& command, Options& options) {
  command.add_option("--sizes", options.sizes, "Numbers of Gaussians, for example 10k,100k,1M")
      ->capture_default_str()
      ->type_name("N,...");
  command.add_flag("--large", options.large, "Also 3M Gaussians");
  command
      .add_option(
          "--scene", options.scenes,
          fmt::format("{} or all, several with commas", fmt::join(bench_scene_names(), ", ")))
      ->capture_default_str()
      ->type_name("NAME,...");
  command.add_option("--model", options.model, "Measure on a PLY or a run's newest model instead")
      ->type_name("MODEL");
  command
      .add_option("--cameras", options.cameras,
                  "With --model: transforms.json or folder of a data set")
      ->type_name("PATH");
  command.add_option("--view", options.view, "With --model: which of the cameras, from 0")
      ->transform(whole_between(0, 1e9))
      ->capture_default_str();
  command.add_option("--resolution", options.resolution, "Pixels (800x800, or the camera's)")
      ->type_name("WxH");
  command.add_option("--sh-degree", options.bench.sh_degree, "Of the generated scenes")
      ->transform(whole_between(0, 4))
      ->capture_default_str();
  command.add_option("--rays", options.bench.rays, "Arbitrary rays, at most")
      ->transform(whole_between(1, 1e9))
      ->capture_default_str();
  command
      .add_option("--triangles", options.bench.triangles,
                  "Of the larger mesh; the smaller has a tenth")
      ->transform(whole_between(100, 1e8))
      ->capture_default_str();
  command.add_option("--filter", options.bench.filter, "Only ids row/scene/size that match this")
      ->type_name("REGEX");
  command.add_flag("--list", options.list, "Print the ids and stop");
  command.add_option("--repeat", options.bench.repeat, "Repetitions of every row")
      ->transform(whole_between(1, 1000))
      ->capture_default_str();
}

/// Options for another result than a table of the rows.
void add_kind_options(CLI::App& command, Options& options) {
  command.add_flag("--forecast", options.forecast,
                   "What a model of speed, from counted work, says of this CPU, beside the "
                   "measurement, and of four graphics cards");
  command
      .add_option("--report", options.report,
                  "Self-test, all rows, frames/s and training iterations/s as one file, in at most "
                  "8 minutes")
      ->check(not_empty())
      ->type_name("FILE");
  command
      .add_option("--kernels", options.kernels,
                  "Compare the kernels of this folder (like cl/ of the source) ...")
      ->type_name("DIR");
  command.add_option("--against", options.against, "... with those of this one, in turns")
      ->type_name("DIR");
}

void add_result_options(CLI::App& command, Options& options) {
  command.add_option("--json", options.json, "Also write the result as JSON")
      ->check(not_empty())
      ->type_name("FILE");
  command.add_option("--csv", options.csv, "Also write the result as CSV")
      ->check(not_empty())
      ->type_name("FILE");
  command.add_option("--html", options.html, "Also write the result as a page")
      ->check(not_empty())
      ->type_name("FILE");
  add_overwrite_flag(command, options.overwrite, kOverwriteFile);
}

}  // namespace

Command add_bench_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("bench", "Measure every kernel and stage on a device");
  auto options = std::make_shared<Options>();
  add_row_options(*command, *options);
  add_kind_options(*command, *options);
  add_result_options(*command, *options);
  add_trace_flags(*command, options->trace);
  add_device_flags(*command, options->device);

  CLI::App* comparison =
      command->add_subcommand("compare", "Ratios of two results that --json wrote");
  auto files = std::make_shared<CompareOptions>();
  comparison->add_option("A", files->before, "Result before")->required();
  comparison->add_option("B", files->after, "Result after")->required();
  return {command, [command, options, files, comparison] {
            if (comparison->parsed()) {
              compare(*files);
            } else {
              run(*command, *options);
            }
          }};
}

}  // namespace raysplats::cli
