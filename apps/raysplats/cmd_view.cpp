// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/interrupt.hpp"
#include "core/morton_order.hpp"
#include "core/orbit.hpp"
#include "io/data_origin.hpp"
#include "io/scene_loader.hpp"
#include "options.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model.hpp"
#include "render_flags.hpp"
#include "train/mirror_meshes.hpp"
#include "train/model_source.hpp"
#include "view/view_state.hpp"
#include "view/viewer.hpp"

namespace raysplats::cli {
namespace {

constexpr std::uint16_t kPort = 7377;

struct Options {
  std::string model;
  DataFlags data;
  std::string cameras;
  std::string host = "127.0.0.1";
  std::uint16_t port = kPort;
  int max_size = view::ViewerOptions{}.max_side;
  std::optional<std::string> up;
  TraceSettings trace;
  DeviceFlags device;
};

/// What is looked at, from where.
struct Subject {
  SceneExtent extent;
  std::vector<Camera> cameras;
  glm::dvec3 up{0, -1, 0};
  Camera start;
};

std::vector<Camera> cameras_of(const Options& options,
                               const Dataset& dataset,
                               const ModelSource& source) {
  std::vector<Camera> cameras;
  if (!options.cameras.empty()) {
    cameras = read_cameras(options.cameras);
    for (Camera& camera : cameras)
      io::move_origin(camera, {source.origin[0], source.origin[1], source.origin[2]});
    return cameras;
  }
  for (const View& each : dataset.views) cameras.push_back(each.camera);
  return cameras;
}

Subject subject_of(const Options& options, const SceneExtent& extent, std::vector<Camera> cameras) {
  Subject subject;
  subject.extent = extent;
  subject.cameras = std::move(cameras);
  subject.extent.center = common_target(subject.cameras).value_or(extent.center);
  subject.up = estimate_up(subject.cameras);
  if (options.up) {
    const std::array<double, 3> up = parse_triple(*options.up);
    subject.up = {up[0], up[1], up[2]};
  }
  OrbitOptions orbit;
  orbit.up = subject.up;
  subject.start = subject.cameras.empty() ? orbit_cameras(subject.extent, orbit).front()
                                          : subject.cameras.front();
  return subject;
}

/// Draws for the pages until a signal comes.
void serve(const Options& options,
           view::PictureSource& pictures,
           const Subject& subject,
           const std::string& about,
           std::optional<float> near_depth) {
  view::ViewState state;
  state.name = std::filesystem::path(options.model).filename().string();
  if (state.name.empty()) state.name = options.model;
  state.about = about;
  state.extent = subject.extent;
  state.up = subject.up;
  state.start = subject.start;
  state.cameras = subject.cameras;
  state.has_near = near_depth.has_value();
  state.near_depth = near_depth.value_or(0.0f);
  state.has_depth = pictures.has_depth();
  view::ViewerOptions viewer_options;
  viewer_options.server.host = options.host;
  viewer_options.server.port = options.port;
  viewer_options.max_side = options.max_size;
  viewer_options.state = view::state_json(state);
  const InterruptGuard interrupt;
  view::Viewer viewer(viewer_options);
  fmt::print("Open {} in a browser; Ctrl-C ends it\n", viewer.url());
  std::fflush(stdout);
  constexpr double kWait = 0.1;
  while (!interrupt.requested()) {
    viewer.work(pictures, 0, kWait, [&] { return interrupt.requested(); });
  }
}

void view_scene(const Options& options) {
  SceneFile file = read_scene_file(options.model);
  find_models(file);
  file.trained = options.trace.over(file.trace.over(file.trained));
  file.trace = {};
  const LoadedScene loaded = load_scene(file);
  Subject subject = subject_of(options, scene_extent(loaded.scene.gaussians), loaded.cameras);
  if (!options.up && file.camera.up) subject.up = *file.camera.up;
  const std::unique_ptr<Context> context = open_context(options.device);
  const auto pictures = view::scene_pictures(*context, loaded.scene);
  serve(options, *pictures, subject,
        fmt::format("{} Gaussians, {} meshes, {} lights", loaded.scene.gaussians.size(),
                    loaded.scene.meshes.size(), loaded.scene.lights.size()),
        std::nullopt);
}

void view_model(const Options& options) {
  const ModelSource source = find_model(options.model);
  const Gaussians gaussians = in_morton_order(read_model(source.file));
  Dataset dataset;
  if (!options.data.data.empty())
    dataset = load_dataset(options.data.data, options.data.over(dataset_options(source)));
  const TraceOptions trace = options.trace.over(trace_options(source, dataset.alpha_is_background));
  const Subject subject =
      subject_of(options, scene_extent(gaussians), cameras_of(options, dataset, source));
  const Mirrors mirrors = mirrors_of(source);
  const std::unique_ptr<Context> context = open_context(options.device);
  const Model model(*context, gaussians);
  const auto pictures = view::model_pictures(*context, model, trace, mirrors);
  serve(options, *pictures, subject,
        fmt::format("{} Gaussians, SH degree {}", gaussians.size(), gaussians.sh_degree),
        mirrors.meshes.empty() ? std::optional(trace.near_depth) : std::nullopt);
}

void run(const Options& options) {
  if (is_scene_file(options.model)) {
    if (!options.data.data.empty() || !options.cameras.empty()) {
      throw UsageError("--data and --cameras are for models: a scene file has its own [camera]");
    }
    view_scene(options);
  } else {
    view_model(options);
  }
}

}  // namespace

Command add_view_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("view", "Show a model or a scene file in a browser, live");
  auto options = std::make_shared<Options>();
  command
      ->add_option(
          "MODEL", options->model,
          "Model (PLY, .splat, SPZ, glTF), the folder of a training run, or a scene file (.toml)")
      ->required()
      ->type_name("");
  add_data_flags(*command, options->data);
  command
      ->add_option("--cameras", options->cameras,
                   "Cameras of a transforms.json, for the page's list")
      ->type_name("FILE");
  command
      ->add_option("--host", options->host,
                   "Address to listen on; other machines can reach any but 127.0.0.1, and whoever "
                   "has the printed address may look")
      ->type_name("ADDRESS")
      ->capture_default_str();
  command->add_option("--port", options->port, "Port to listen on; 0 = any that is free")
      ->transform(whole_between(0, 65535))
      ->capture_default_str();
  command->add_option("--max-size", options->max_size, "Largest side of the pictures in pixels")
      ->transform(whole_between(64, 8192))
      ->capture_default_str();
  command
      ->add_option("--up", options->up,
                   "World direction that is up (default: the cameras', else 0,-1,0)")
      ->check(triple())
      ->type_name("X,Y,Z");
  add_trace_flags(*command, options->trace);
  add_device_flags(*command, options->device);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
