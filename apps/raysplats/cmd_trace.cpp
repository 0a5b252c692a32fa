// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "commands.hpp"
#include "io/scene/ray_file.hpp"
#include "model_argument.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/tracer.hpp"
#include "run/model_source.hpp"
#include "scene/morton_order.hpp"
#include "util/atomic_file.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string model;
  std::string rays;
  std::string output;
  std::string color_direction = "ray";
  bool overwrite = false;
  TraceSettings trace;
  DeviceFlags device;
};

void run(const Options& options) {
  const ModelSource source = find_model(options.model);
  check_output_file(options.output, options.overwrite, {source.file, source.config, options.rays});
  if (std::filesystem::path(options.output).extension() == ".npy") {
    throw UsageError(
        fmt::format("--output {}: a .npy file holds one array and there are five, give a .npz",
                    options.output));
  }
  if (source.trained && !source.trained->mirrors.empty()) {
    spdlog::warn(
        "{} was trained with mirrors, which rays of your own do not meet: only what Gaussians show "
        "is traced",
        source.file.string());
  }
  const io::RayList list = io::read_rays(options.rays, source.origin);
  const Gaussians gaussians = in_morton_order(read_model(source.file));
  const TraceOptions trace = options.trace.over(trace_options(source));
  if (trace.near_depth > 0.0f) {
    throw UsageError(
        "--near is about cameras, and rays begin at their own t_min: give --near 0, also for a "
        "model that was trained with another");
  }
  const std::unique_ptr<Context> context = open_context(options.device);
  const Model model(*context, gaussians);
  Tracer tracer(*context, trace);
  const auto direction =
      options.color_direction == "origin" ? ColorDirection::kFromOrigin : ColorDirection::kRay;
  const auto start = std::chrono::steady_clock::now();
  const std::vector<RayResult> results = tracer.trace(model, list.rays, direction);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  io::write_ray_results(options.output, list.shape, results);
  warn_of_capped_rays(tracer.capped_rays(), results.size(), trace);
  fmt::print("{} rays in {} ({:.2f} s of building and tracing)\n", results.size(), options.output,
             seconds);
  if (options.device.profile) fmt::print("{}", context->profile_table());
}

}  // namespace

Command add_trace_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("trace", "Trace rays of your own through a model");
  auto options = std::make_shared<Options>();
  add_model_argument(*command, options->model);
  command
      ->add_option("--rays", options->rays,
                   "Array (..., 6) of origins and directions, or (..., 8) with t_min and t_max, of "
                   "floats or whole numbers")
      ->required()
      ->type_name("FILE.npy");
  command
      ->add_option("-o,--output", options->output,
                   "Arrays color, alpha, depth, median_depth and hits, as the rays are shaped")
      ->required()
      ->check(not_empty())
      ->type_name("FILE.npz");
  command
      ->add_option(
          "--color-direction", options->color_direction,
          "Colours are seen along the ray, or from its origin as cameras see them (origin)")
      ->check(one_of({"ray", "origin"}))
      ->capture_default_str();
  add_overwrite_flag(*command, options->overwrite, kOverwriteFile);
  add_trace_flags(*command, options->trace);
  command->remove_option(command->get_option("--view-footprint"));  // rays have no pixel
  add_device_flags(*command, options->device);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
