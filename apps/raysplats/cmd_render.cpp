// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>

#include "frame_progress.hpp"
#include "io/camera_list.hpp"
#include "io/data_origin.hpp"
#include "io/scene_camera.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/frame_writer.hpp"
#include "render/output_check.hpp"
#include "render_flags.hpp"
#include "render_output.hpp"
#include "run/model_source.hpp"
#include "scene/camera_check.hpp"
#include "scene/camera_path.hpp"
#include "scene/morton_order.hpp"
#include "scene/orbit.hpp"
#include "shared_work.hpp"
#include "train/mirror_meshes.hpp"
#include "util/number_text.hpp"

namespace raysplats::cli {
namespace {

void check(const RenderFlags& options) {
  options.frame_options();
  const std::pair<const char*, bool> of_scenes[] = {
      {"--samples", options.render.has("samples")},
      {"--max-bounces", options.render.has("max-bounces")},
      {"--seed", options.render.has("seed")},
      {"--frames", !options.frames.empty()}};
  for (const auto& [name, given] : of_scenes) {
    if (given) {
      throw UsageError(fmt::format("{} is for scene files: MODEL is {}, which is no .toml", name,
                                   options.model));
    }
  }
  options.check_path_options();
  const bool data = !options.data.data.empty();
  const int along =
      (options.ellipse ? 1 : 0) + (options.spiral ? 1 : 0) + (options.interpolate ? 1 : 0);
  const int made = along + (options.orbit ? 1 : 0);
  const int files = (options.cameras.empty() ? 0 : 1) + (options.path.empty() ? 0 : 1);
  if (!data && made + files == 0) {
    throw UsageError(
        "There are no cameras to render from: give --data DATASET, --cameras transforms.json, "
        "--path FILE or --orbit N");
  }
  if (made > 1 || files > 1) {
    throw UsageError(
        "--orbit, --ellipse, --spiral, --interpolate, --cameras and --path are paths of their "
        "own: choose one");
  }
  if (files > 0 && (made > 0 || data)) {
    throw UsageError(
        "--cameras and --path bring their own cameras: leave out --data and --orbit, --ellipse, "
        "--spiral and --interpolate, which go with --data");
  }
  if (along > 0 && !data)
    throw UsageError("--ellipse, --spiral and --interpolate follow photos: add --data DATASET");
  const bool shaped =
      options.fov || options.elevation || options.distance || options.up || options.camera_model;
  if (shaped && !options.orbit) {
    throw UsageError(
        "--fov, --elevation, --distance, --up and --camera-model shape an orbit: add --orbit N");
  }
  if ((options.width || options.height) && made == 0 && options.path.empty()) {
    throw UsageError(
        "--width and --height are for --path and --orbit, --ellipse, --spiral or --interpolate: "
        "other cameras have their sizes, which --downscale reduces");
  }
  options.data.check_used(made > 0);
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

/// Cameras that follow the photos of a data set.
std::vector<Camera> along(const RenderFlags& options, const std::vector<Camera>& photos) {
  std::vector<Camera> cameras = options.ellipse ? ellipse_cameras(photos, *options.ellipse)
                                : options.spiral
                                    ? spiral_cameras(photos, *options.spiral)
                                    : interpolated_cameras(photos, *options.interpolate);
  for (Camera& camera : cameras) camera = resized(camera, options.width, options.height);
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
  shape.model = camera_model(options.camera_model.value_or("pinhole"));
  // Check the direction before the photos are measured along it.
  orbit_cameras(extent, shape);
  shape = orbit_like(photos, extent.center, shape);
  if (!photos.empty()) {
    const Camera& first = photos.front();
    shape.width = first.width;
    shape.height = first.height;
    shape.fov_degrees = field_of_view(first, shape.model);
  }
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
    dataset = load_dataset(options.data.data, options.data.settings.over(dataset_options(source)));
  }

  std::vector<Camera> cameras;
  std::optional<double> fps;
  bool closed = options.orbit || options.ellipse || options.spiral;
  if (options.orbit) {
    cameras = orbit(options, model, cameras_of(dataset, Split::kAll));
  } else if (options.ellipse || options.spiral || options.interpolate) {
    cameras = along(options, cameras_of(dataset, Split::kAll));
  } else if (!options.cameras.empty() || !options.path.empty()) {
    const glm::dvec3 origin(source.origin[0], source.origin[1], source.origin[2]);
    if (!options.path.empty()) {
      CameraPathFile path = read_path(options);
      cameras = std::move(path.cameras);
      fps = path.fps;
      closed = path.closed;
      for (Camera& camera : cameras) io::move_origin(camera, origin);
    } else {
      cameras = io::read_model_cameras(options.cameras, origin);
    }
    const double factor = options.data.settings.over({}).downscale;
    for (Camera& camera : cameras) camera = downscaled(camera, factor);
  } else {
    cameras = cameras_of(dataset, options.data.chosen_split());
  }
  if (cameras.empty()) throw no_views(options.data);
  if (!options.data.data.empty() && !options.output.empty())
    check_not_data(options.output, dataset);
  RenderOutput output(options, cameras, cameras.size(), fps, closed);

  TraceOptions trace = options.trace.over(trace_options(source));
  trace.depth = options.depth || options.hits;
  share_work(options.device, global, [&](Communicator& ranks, Context& context) {
    const Model on_device(context, model);
    Tracer tracer(context, trace, mirrors_of(source));
    const FrameOptions share = share_of(ranks, output.options(), cameras.size());
    output.begin();
    spdlog::info("{} Gaussians of {}, {} views", model.size(), source.file.string(),
                 cameras.size());

    FrameProgress progress("rendering", cameras.size(), ranks, global.quiet);
    FrameReport report = write_frames(
        tracer, on_device, cameras, options.output, share,
        [&](std::size_t done) { return progress.done(done); },
        [&](double share) { return progress.within(share); });
    report.frames = sum_over(ranks, report.frames);
    report.rays = sum_over(ranks, report.rays);
    report.capped_rays = sum_over(ranks, report.capped_rays);
    report.trace_seconds = most_of(ranks, report.trace_seconds);
    progress.finish(report.frames, "frames: what is in " + output.name() + " is whole");
    if (!ranks.leads()) return;
    output.finish();
    warn_of_capped_rays(report.capped_rays, report.rays, trace);
    const std::string speed =
        fmt::format("{:.2f} s of tracing, {:.2f} million rays per second", report.trace_seconds,
                    1e-6 * static_cast<double>(report.rays) / report.trace_seconds);
    fmt::print("{} in {} ({})\n", counted(report.frames, "frame"), output.name(),
               with_compiling(speed, context.build_seconds()));
    if (options.device.profile) fmt::print("{}", context.profile_table());
  });
}

}  // namespace

Command add_render_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand(
      "render", "Render a model or a scene file from a data set's cameras, a file's or an orbit");
  auto options = std::make_shared<RenderFlags>();
  command
      ->add_option("MODEL", options->model,
                   "Model (PLY, .splat, SPZ, SOG, glTF), the folder of a training run, or a scene "
                   "file (.toml)")
      ->required()
      ->type_name("");
  command->add_option("-o,--output", options->output, "Folder for the frames")->type_name("DIR");
  command
      ->add_option("--video", options->video,
                   "All frames as one file: .mp4 or .webm (by ffmpeg), .gif or .apng")
      ->type_name("FILE");
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
  command->add_option("--cameras", options->cameras, "transforms.json or cameras.json with cameras")
      ->group(where)
      ->type_name("FILE");
  command
      ->add_option("--orbit", options->orbit,
                   "N cameras on a circle around the model (with --data: as its cameras)")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");

  command
      ->add_option("--path", options->path,
                   "Camera path: JSON of nerfstudio or the viewer's page, or keyframes in TOML")
      ->group(where)
      ->type_name("FILE");
  command
      ->add_option("--ellipse", options->ellipse,
                   "N cameras on the ellipse along which --data's photos lie")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");
  command
      ->add_option("--spiral", options->spiral, "N cameras on a spiral about --data's mean photo")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");
  command
      ->add_option("--interpolate", options->interpolate,
                   "From photo to photo of --data, N frames each")
      ->group(where)
      ->transform(whole_between(1, 1e4))
      ->type_name("N");

  const std::string time = "Time";
  command
      ->add_option("--seconds", options->seconds,
                   "Of --path (the file's), or in which all frames of --video go by")
      ->group(time)
      ->transform(between(1e-3, 86400));
  command
      ->add_option("--fps", options->fps,
                   "Frames a second of --path and --video (the file's, or 30)")
      ->group(time)
      ->transform(between(kLeastFps, kMostFps));
  command
      ->add_flag("--constant-speed", options->constant_speed,
                 "The eye of --path moves at one speed, whatever the file says of seconds")
      ->group(time);
  command
      ->add_option("--path-transform", options->path_transform,
                   "dataparser_transforms.json of nerfstudio, for paths in its scaled world")
      ->group(time)
      ->type_name("FILE");
  command
      ->add_option("--path-data", options->path_data,
                   "With it, the transforms.json that the model was trained from, where that has "
                   "an applied_transform")
      ->group(time)
      ->type_name("FILE");
  command
      ->add_option("--shutter-samples", options->shutter_samples,
                   "Motion blur: moments of every frame that are averaged")
      ->group(time)
      ->transform(whole_between(1, 1024))
      ->type_name("N");
  command
      ->add_option("--shutter", options->shutter,
                   "Share of the time to the next frame in which they lie (0.5)")
      ->group(time)
      ->transform(between(1e-3, 1));

  const std::string orbit = "Orbit";
  command
      ->add_option("--width", options->width,
                   "Pixels (800, or the data set's; one side alone keeps the shape)")
      ->group(orbit)
      ->transform(whole_between(1, kMaxSide));
  command->add_option("--height", options->height, "Pixels")
      ->group(orbit)
      ->transform(whole_between(1, kMaxSide));
  command
      ->add_option("--fov", options->fov, "Degrees along the smaller side (45, or the data set's)")
      ->group(orbit)
      ->transform(between(kLeastFov, most_fov(CameraModel::kFisheye)));
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
  add_render_flags(*command, options->render, scene);
  command
      ->add_option("--frames", options->frames,
                   "Only the frames from START up to END, which is left out; either may be empty")
      ->group(scene)
      ->type_name("START:END");

  command->add_option("--supersample", options->supersample, "S x S rays per pixel, averaged")
      ->transform(whole_between(1, 16));
  command->add_flag("--depth", options->depth,
                    "Also expected depth: channel Z of an EXR, or NAME_depth.png");
  command->add_flag("--normals", options->normals,
                    "Also normals: channels N.X, N.Y, N.Z of an EXR in world axes, or "
                    "NAME_normals.png in the camera's (right red, up green, near blue)");
  command->add_flag("--hits", options->hits,
                    "Also the number of blended Gaussians: channel hits of an EXR, or "
                    "NAME_hits.png (white: the most of the frame)");
  add_trace_flags(*command, options->trace);
  add_traversal_flag(*command, options->trace);
  add_device_flags(*command, options->device);
  return {command, [options, &global] { run(*options, global); }};
}

}  // namespace raysplats::cli
