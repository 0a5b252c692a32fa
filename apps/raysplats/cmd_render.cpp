// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>

#include "base/output_directory.hpp"
#include "core/morton_order.hpp"
#include "core/orbit.hpp"
#include "eval/frame_writer.hpp"
#include "eval/output_check.hpp"
#include "frame_progress.hpp"
#include "io/data_origin.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render_flags.hpp"
#include "train/mirror_meshes.hpp"
#include "train/model_source.hpp"

namespace raysplats::cli {
namespace {

void check(const RenderFlags& options) {
  options.frame_options();
  const std::pair<const char*, bool> of_scenes[] = {
      {"--samples", options.samples.has_value()},
      {"--max-bounces", options.max_bounces.has_value()},
      {"--seed", options.seed.has_value()},
      {"--frames", !options.frames.empty()}};
  for (const auto& [name, given] : of_scenes) {
    if (given) {
      throw UsageError(fmt::format("{} is for scene files: MODEL is {}, which is no .toml", name,
                                   options.model));
    }
  }
  const int sources = (options.data.data.empty() ? 0 : 1) + (options.cameras.empty() ? 0 : 1);
  if (sources == 0 && !options.orbit) {
    throw UsageError(
        "There are no cameras to render from: give --data DATASET, --cameras transforms.json or "
        "--orbit N");
  }
  if (sources == 2 || (options.orbit && !options.cameras.empty())) {
    throw UsageError(
        "--cameras is a path of its own: leave out --data and --orbit, or leave out --cameras "
        "(--orbit goes with --data)");
  }
  const bool shaped = options.width || options.height || options.fov || options.elevation ||
                      options.distance || options.up || options.camera_model;
  if (shaped && !options.orbit) {
    throw UsageError(
        "--width, --height, --fov, --elevation, --distance, --up and --camera-model shape an "
        "orbit: add --orbit N");
  }
  options.data.check_used(options.orbit.has_value());
  if (options.fov && options.camera_model == "equirectangular") {
    throw UsageError(
        "--fov is for other camera models: an equirectangular picture shows everything around");
  }
}

CameraModel camera_model(const std::string& name) {
  if (name == "fisheye") return CameraModel::kFisheye;
  if (name == "equirectangular") return CameraModel::kEquirectangular;
  if (name == "orthographic") return CameraModel::kOrthographic;
  return CameraModel::kPinhole;
}

std::vector<Camera> cameras_of(const Dataset& dataset, Split split) {
  std::vector<Camera> cameras;
  for (const std::size_t i : dataset.indices(split)) cameras.push_back(dataset.views[i].camera);
  return cameras;
}

std::vector<Camera> orbit(const RenderFlags& options,
                          const Gaussians& model,
                          const std::vector<Camera>& photos) {
  OrbitOptions shape;
  shape.frames = *options.orbit;
  shape.up = estimate_up(photos);
  if (options.up) {
    const std::array<double, 3> up = parse_triple(*options.up);
    shape.up = {up[0], up[1], up[2]};
  }
  SceneExtent extent = scene_extent(model);
  extent.center = common_target(photos).value_or(extent.center);
  // Check the direction before the photos are measured along it.
  orbit_cameras(extent, shape);
  shape = orbit_like(photos, extent.center, shape);
  if (!photos.empty()) {
    const Camera& first = photos.front();
    shape.width = first.width;
    shape.height = first.height;
    shape.fov_degrees = field_of_view(first);
  }
  shape.model = camera_model(options.camera_model.value_or("pinhole"));
  if (shape.model == CameraModel::kEquirectangular) shape.width = 2 * shape.height;
  // One side alone keeps the picture's shape.
  const double aspect = static_cast<double>(shape.width) / shape.height;
  const auto rounded = [](double side) { return std::max(1, static_cast<int>(std::lround(side))); };
  if (options.width) shape.width = *options.width;
  if (options.width && !options.height) shape.height = rounded(*options.width / aspect);
  if (options.height) shape.height = *options.height;
  if (options.height && !options.width) shape.width = rounded(*options.height * aspect);
  if (options.fov) shape.fov_degrees = *options.fov;
  if (options.elevation) shape.elevation_degrees = *options.elevation;
  if (options.distance) shape.distance = *options.distance;
  return orbit_cameras(extent, shape);
}

void run(const RenderFlags& options, const GlobalOptions& global) {
  if (is_scene_file(options.model)) {
    if (options.camera_model) {
      throw UsageError(
          fmt::format("--camera-model is for models: the lens of {} is the [camera] of the file",
                      options.model));
    }
    render_scene(options, global);
    return;
  }
  check(options);
  const ModelSource source = find_model(options.model);
  const Gaussians model = in_morton_order(read_model(source.file));
  Dataset dataset;
  if (!options.data.data.empty()) {
    dataset = load_dataset(options.data.data, options.data.over(dataset_options(source)));
  }

  std::vector<Camera> cameras;
  if (options.orbit) {
    cameras = orbit(options, model, cameras_of(dataset, Split::kAll));
  } else if (!options.cameras.empty()) {
    for (const Camera& camera : read_cameras(options.cameras)) {
      cameras.push_back(downscaled(camera, options.data.downscale.value_or(1.0)));
      io::move_origin(cameras.back(), {source.origin[0], source.origin[1], source.origin[2]});
    }
  } else {
    cameras = cameras_of(dataset, options.data.chosen_split());
  }
  if (cameras.empty()) throw no_views(options.data);
  if (!options.data.data.empty()) check_not_data(options.output, dataset);
  if (!options.cameras.empty()) check_not_data(options.output, options.cameras);
  check_leftovers(options.output, frame_names(cameras), options.frame_options().format,
                  options.overwrite);

  TraceOptions trace = options.trace.over(trace_options(source, dataset.alpha_is_background));
  trace.depth = options.depth;
  const std::unique_ptr<Context> context = open_context(options.device);
  const Model on_device(*context, model);
  Tracer tracer(*context, trace, mirrors_of(source));
  make_output_directory(options.output);
  spdlog::info("{} Gaussians of {}, {} views", model.size(), source.file.string(), cameras.size());

  FrameProgress progress("rendering", cameras.size(), global.quiet);
  const FrameReport report = write_frames(
      tracer, on_device, cameras, options.output, options.frame_options(),
      [&](std::size_t done) { return progress.done(done); },
      [&](double share) { return progress.within(share); });
  progress.finish(report.frames, "frames: what is in " + options.output + " is whole");
  warn_of_capped_rays(report.capped_rays, report.rays, trace);
  const std::string speed =
      fmt::format("{:.2f} s of tracing, {:.2f} million rays per second", report.trace_seconds,
                  1e-6 * static_cast<double>(report.rays) / report.trace_seconds);
  fmt::print("{} frames in {} ({})\n", report.frames, options.output,
             with_compiling(speed, context->build_seconds()));
  if (options.device.profile) fmt::print("{}", context->profile_table());
}

}  // namespace

Command add_render_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand(
      "render", "Render a model or a scene file from a data set's cameras, a file's or an orbit");
  auto options = std::make_shared<RenderFlags>();
  command
      ->add_option(
          "MODEL", options->model,
          "Model (PLY, .splat, SPZ, glTF), the folder of a training run, or a scene file (.toml)")
      ->required()
      ->type_name("");
  command->add_option("-o,--output", options->output, "Folder for the frames")
      ->required()
      ->type_name("DIR");
  add_overwrite_flag(*command, options->overwrite);
  command->add_option("--format", options->format, "exr (float RGBA), png or jpg (8-bit RGB)")
      ->check(one_of({"exr", "png", "jpg"}))
      ->capture_default_str();
  command
      ->add_option("--exr", options->exr,
                   "Numbers of an EXR: linear (default), as other programs expect, or display, the "
                   "values as trained that PNG and JPG hold")
      ->check(one_of({"linear", "display"}));

  add_data_flags(*command, options->data);
  const std::string where = "Other cameras";
  command->add_option("--cameras", options->cameras, "transforms.json with cameras")
      ->group(where)
      ->type_name("FILE");
  command
      ->add_option("--orbit", options->orbit,
                   "N cameras on a circle around the model (with --data: as its cameras)")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");

  const std::string orbit = "Orbit";
  command
      ->add_option("--width", options->width,
                   "Pixels (800, or the data set's; one side alone keeps the shape)")
      ->group(orbit)
      ->transform(whole_between(1, 65536));
  command->add_option("--height", options->height, "Pixels")
      ->group(orbit)
      ->transform(whole_between(1, 65536));
  command
      ->add_option("--fov", options->fov, "Degrees along the smaller side (45, or the data set's)")
      ->group(orbit)
      ->transform(between(0.1, 360));
  command
      ->add_option("--elevation", options->elevation,
                   "Degrees above the centre (20, or the cameras' median)")
      ->group(orbit)
      ->transform(between(-89.9, 89.9));
  command
      ->add_option("--distance", options->distance,
                   "Of the eye from the centre (the model fits, or the cameras' median)")
      ->group(orbit)
      ->transform(between(1e-9, kNoBound));
  command
      ->add_option("--camera-model", options->camera_model,
                   "pinhole, fisheye, equirectangular (twice as wide as high) or orthographic")
      ->group(orbit)
      ->check(one_of({"pinhole", "fisheye", "equirectangular", "orthographic"}));
  command->add_option("--up", options->up, "World direction that is up (0,-1,0, or the cameras')")
      ->group(orbit)
      ->check(triple())
      ->type_name("X,Y,Z");

  const std::string scene = "Scene files (over what they say)";
  command->add_option("--samples", options->samples, "Rays per pixel")
      ->group(scene)
      ->transform(whole_between(1, 65536));
  command->add_option("--max-bounces", options->max_bounces, "Surfaces that a path may meet")
      ->group(scene)
      ->transform(whole_between(1, 1000));
  command->add_option("--seed", options->seed, "Of everything that is random")
      ->group(scene)
      ->transform(seed());
  command
      ->add_option("--frames", options->frames,
                   "Only the frames from START up to END, which is left out; either may be empty")
      ->group(scene)
      ->type_name("START:END");

  command->add_option("--supersample", options->supersample, "S x S rays per pixel, averaged")
      ->transform(whole_between(1, 16));
  command->add_flag("--depth", options->depth,
                    "Also expected depth: channel Z of an EXR, or NAME_depth.png");
  add_trace_flags(*command, options->trace);
  add_traversal_flag(*command, options->trace);
  add_device_flags(*command, options->device);
  return {command, [options, &global] { run(*options, global); }};
}

}  // namespace raysplats::cli
