// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <glm/geometric.hpp>
#include <memory>

#include "commands.hpp"
#include "frame_progress.hpp"
#include "io/dataset/camera_list.hpp"
#include "io/dataset/data_origin.hpp"
#include "io/dataset/dataset_views.hpp"
#include "io/scene/scene_camera.hpp"
#include "io/scene/scene_file.hpp"
#include "model_argument.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render/frame_writer.hpp"
#include "render/output_check.hpp"
#include "render_flags.hpp"
#include "render_output.hpp"
#include "run/mirror_meshes.hpp"
#include "run/model_source.hpp"
#include "run/run_cameras.hpp"
#include "scene/camera/camera_path.hpp"
#include "scene/camera/orbit.hpp"
#include "scene/morton_order.hpp"
#include "shared_work.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"

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

// A circle leaves rooms through their walls, and goes behind what was taken from one side.
void warn_of_unseen(const std::vector<Camera>& frames,
                    const std::vector<Camera>& photos,
                    double distance) {
  constexpr double kReach = 0.8;          // of the way to the centre: 47 degrees along the circle
  constexpr std::size_t kUsualOneIn = 4;  // frames between photos that are far apart
  if (photos.empty()) return;
  const std::size_t unseen = unseen_views(frames, photos, kReach * distance);
  if (unseen * kUsualOneIn <= frames.size()) return;
  spdlog::warn(
      "{} of {} frames of the orbit look from where no photo was taken, as through walls: what "
      "they show is a guess; --interpolate N (or --ellipse N, --spiral N) with --data stays with "
      "the photos",
      unseen, frames.size());
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
  std::vector<Camera> frames = orbit_cameras(extent, shape);
  warn_of_unseen(frames, photos, glm::distance(frames.front().center(), extent.center));
  return frames;
}

/// The cameras of the frames, and how their time goes by.
struct RenderViews {
  std::vector<Camera> cameras;
  std::optional<double> fps;  ///< of a path
  bool closed = false;        ///< the frame after the last one is the first
};

/// The cameras of --cameras or --path, from where the model's positions count.
RenderViews file_views(const RenderFlags& options, const ModelSource& source) {
  const glm::dvec3 origin(source.origin[0], source.origin[1], source.origin[2]);
  RenderViews views;
  if (options.path.empty()) {
    views.cameras = io::read_model_cameras(options.cameras, origin);
  } else {
    CameraPathFile path = read_path(options);
    for (Camera& camera : path.cameras) io::move_origin(camera, origin);
    views = {std::move(path.cameras), path.fps, path.closed};
  }
  const double factor = options.data.settings.over({}).factor();
  for (Camera& camera : views.cameras) camera = downscaled(camera, factor);
  return views;
}

/// The cameras that the options choose. `dataset` is that of --data, empty without one.
RenderViews render_views(const RenderFlags& options,
                         const ModelSource& source,
                         const Gaussians& model,
                         const Dataset& dataset) {
  if (!options.cameras.empty() || !options.path.empty()) return file_views(options, source);
  RenderViews views;
  views.closed = options.orbit || options.ellipse || options.spiral;
  if (options.orbit) {
    views.cameras = orbit(options, model,
                          options.data.data.empty() ? readable_run_cameras(source, "the orbit")
                                                    : cameras_of(dataset, Split::kAll));
  } else if (options.ellipse || options.spiral || options.interpolate) {
    views.cameras = along(options, cameras_of(dataset, Split::kAll));
  } else {
    views.cameras = cameras_of(dataset, options.data.chosen_split());
  }
  return views;
}

// All ranks: the report of all.
void add_up(Communicator& ranks, FrameReport& report) {
  report.frames = sum_over(ranks, report.frames);
  report.rays = sum_over(ranks, report.rays);
  report.reflected_rays = sum_over(ranks, report.reflected_rays);
  report.capped_rays = sum_over(ranks, report.capped_rays);
  report.trace_seconds = most_of(ranks, report.trace_seconds);
}

void print_summary(const FrameReport& report, const std::string& output, double compiling) {
  const std::string speed =
      fmt::format("{:.2f} s of tracing, {:.2f} million rays per second", report.trace_seconds,
                  1e-6 * static_cast<double>(report.rays) / report.trace_seconds);
  fmt::print("{} in {} ({})\n", counted(report.frames, "frame"), output,
             with_compiling(speed, compiling));
}

void render_model(const RenderFlags& options, const GlobalOptions& global) {
  check(options);
  const ModelSource source = find_model(options.model);
  const Gaussians model = in_morton_order(read_model(source.file));
  Dataset dataset;
  if (!options.data.data.empty()) {
    const bool all = options.orbit || options.ellipse || options.spiral || options.interpolate ||
                     options.data.chosen_split() == Split::kAll;
    dataset = load_dataset(options.data.data, options.data.over(dataset_options(source), all));
  }
  const RenderViews views = render_views(options, source, model, dataset);
  const std::vector<Camera>& cameras = views.cameras;
  if (cameras.empty()) throw no_views(options.data);
  if (!options.data.data.empty() && !options.output.empty())
    check_not_data(options.output, dataset);
  RenderOutput output(options, cameras, cameras.size(), views.fps, views.closed);

  TraceOptions trace = options.trace.over(trace_options(source));
  trace.depth = options.depth || options.hits;
  share_work(options.device, global, [&](Communicator& ranks, Context& context) {
    const Model on_device(context, model);
    Tracer tracer(context, trace, mirrors_of(source));
    FrameProgress progress("rendering", cameras.size(), ranks, global.quiet);
    output.begin(ranks);
    const FrameOptions share = share_of(ranks, output.options(), cameras.size());
    spdlog::info("{} Gaussians of {}, {} views", model.size(), source.file.string(),
                 cameras.size());

    FrameReport report = write_frames(
        tracer, on_device, cameras, options.output, share,
        [&](std::size_t done) { return progress.done(done); },
        [&](double share) { return progress.within(share); });
    add_up(ranks, report);
    progress.finish(report.frames, output.left());
    if (!ranks.leads()) return;
    output.finish();
    warn_of_capped_rays(report.capped_rays, report.rays + report.reflected_rays, trace);
    print_summary(report, output.name(), context.build_seconds());
    if (options.device.profile) fmt::print("{}", context.profile_table());
  });
}

void run(const RenderFlags& options, const GlobalOptions& global) {
  if (!is_scene_file(options.model)) {
    render_model(options, global);
    return;
  }
  if (options.camera_model) {
    throw UsageError(fmt::format(
        "--camera-model is for models: the lens of {} is the [camera] of the file", options.model));
  }
  render_scene(options, global);
}

}  // namespace

Command add_render_command(CLI::App& app, const GlobalOptions& global) {
  CLI::App* command = app.add_subcommand(
      "render", "Render a model or a scene file from a data set's cameras, a file's or an orbit");
  auto options = std::make_shared<RenderFlags>();
  add_model_argument(*command, options->model, true);
  add_render_options(*command, *options);
  return {command, [options, &global] { run(*options, global); }};
}

}  // namespace raysplats::cli
