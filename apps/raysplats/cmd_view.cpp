// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "io/dataset/camera_list.hpp"
#include "io/scene/scene_file.hpp"
#include "io/scene/scene_loader.hpp"
#include "model_argument.hpp"
#include "options.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model.hpp"
#include "run/mirror_meshes.hpp"
#include "run/model_source.hpp"
#include "run/run_cameras.hpp"
#include "scene/camera/orbit.hpp"
#include "scene/morton_order.hpp"
#include "scene/options/trace_option_table.hpp"
#include "util/interrupt.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"
#include "view/dropped_meshes.hpp"
#include "view/photos.hpp"
#include "view/view_state.hpp"
#include "view/viewer.hpp"
#include "viewer_flags.hpp"

namespace raysplats::cli {
namespace {

struct Options {
  std::string model;
  DataFlags data;
  std::string cameras;
  view::ViewerOptions viewer = view_options();
  std::optional<std::string> up;
  TraceSettings trace;
  DeviceFlags device;
};

Split split_of(const Options& options) {
  return options.data.split ? options.data.chosen_split() : Split::kAll;
}

/// The views whose cameras the page lists, in its order.
std::vector<View> views_of(const Options& options, const Dataset& dataset) {
  std::vector<View> views;
  for (const std::size_t i : dataset.indices(split_of(options))) views.push_back(dataset.views[i]);
  return views;
}

std::vector<Camera> cameras_of(const Options& options,
                               const std::vector<View>& views,
                               const ModelSource& source) {
  std::vector<Camera> cameras;
  if (!options.cameras.empty()) {
    return io::read_model_cameras(options.cameras,
                                  {source.origin[0], source.origin[1], source.origin[2]});
  }
  if (options.data.data.empty()) return readable_run_cameras(source, "the page");
  cameras.reserve(views.size());
  for (const View& each : views) cameras.push_back(each.camera);
  return cameras;
}

std::optional<glm::dvec3> up_of(const Options& options) {
  if (!options.up) return std::nullopt;
  const std::array<double, 3> up = parse_triple(*options.up);
  return glm::dvec3(up[0], up[1], up[2]);
}

/// A model with the light that dropped meshes get, as scene_head() and scene_tail() say it.
Scene scene_of(const Gaussians& gaussians, const TraceOptions& trace, const glm::dvec3& up) {
  Scene scene;
  scene.gaussians = gaussians;
  scene.trace = trace;
  scene.lights.push_back(view::page_light(up));
  if (trace.sky.empty()) {
    scene.environment.color = trace.background;
  } else {
    scene.environment.color = {1, 1, 1};
    scene.environment.sky = trace.sky;
  }
  return scene;
}

std::string scene_head(const ModelSource& source) {
  return fmt::format(
      "# What the page of `raysplats view` showed. The files of the meshes belong beside this "
      "one.\n"
      "\n[[model]]\nfile = {}\n",
      view::quoted(std::filesystem::absolute(source.file).string()));
}

/// Light, samples, and how tracing differs from what the model itself says, `own`.
std::string scene_tail(TraceOptions own, TraceOptions trace, const glm::dvec3& up) {
  const Light light = view::page_light(up);
  std::string text = fmt::format(
      "\n[[light]]\nkind = \"directional\"\ndirection = [{}, {}, {}]\n\n[render]\nsamples = 16\n",
      light.direction[0], light.direction[1], light.direction[2]);
  const std::vector<OptionRow> given = trace_option_rows(trace);
  const std::vector<OptionRow> trained = trace_option_rows(own);
  std::string rows;
  for (std::size_t i = 0; i < given.size(); ++i) {
    if (given[i].name == "near") continue;  // scenes have no near limit
    if (given[i].text() != trained[i].text())
      rows += fmt::format("{} = {}\n", given[i].name, given[i].text());
  }
  return rows.empty() ? text : text + "\n[trace]\n" + rows;
}

/// Draws for the pages until a signal comes.
void serve(const Options& options,
           view::PictureSource& pictures,
           view::ViewState state,
           view::DroppedMeshes* meshes,
           view::Photos* photos = nullptr) {
  state.name = std::filesystem::path(options.model).filename().string();
  if (state.name.empty()) state.name = options.model;
  state.has_depth = pictures.has_depth();
  view::ViewerOptions viewer_options = options.viewer;
  state.has_photos = photos != nullptr;
  state.takes_meshes = meshes != nullptr;
  viewer_options.meshes = meshes;
  viewer_options.state = view::state_json(state);
  if (photos != nullptr)
    viewer_options.photo = [photos](std::size_t number) { return photos->jpeg(number); };
  const InterruptGuard interrupt;
  view::Viewer viewer(viewer_options);
  fmt::print("Open {} in a browser; Ctrl-C ends it\n", fmt::join(viewer.urls(), " or "));
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
  std::optional<glm::dvec3> up = up_of(options);
  if (!up) up = file.camera.up;
  if (file.camera.source == SceneCamera::Source::kNone) {
    // The page begins where it does with a model. An eye above the centre does not tell what is up.
    up = up.value_or(glm::dvec3(0, -1, 0));
    file.camera.source = SceneCamera::Source::kOrbit;
    file.camera.up = up;
    file.frames = 1;
  }
  const LoadedScene loaded = load_scene(file);
  view::ViewState state = view::first_look(loaded.extent, loaded.cameras, up);
  const std::array<double, 3> origin = file.trained_data.origin.value_or(std::array<double, 3>{});
  state.origin = {origin[0], origin[1], origin[2]};
  state.about = fmt::format("{}, {}, {}", counted(loaded.scene.gaussians.size(), "Gaussian"),
                            counted(loaded.scene.meshes.size(), "mesh", "meshes"),
                            counted(loaded.scene.lights.size(), "light"));
  state.has_background = false;
  const std::unique_ptr<Context> context = open_context(options.device);
  const auto pictures = view::scene_pictures(*context, loaded.scene);
  view::DroppedMeshes meshes(
      [&](const std::vector<Mesh>& shown) { pictures->set_meshes(shown); },
      "# To be added to the scene file; the files of the meshes belong beside it.\n", "");
  serve(options, *pictures, std::move(state), &meshes);
}

void view_model(const Options& options) {
  const ModelSource source = find_model(options.model);
  const Gaussians gaussians = in_morton_order(read_model(source.file));
  Dataset dataset;
  if (!options.data.data.empty()) {
    const bool all = split_of(options) == Split::kAll;
    dataset = load_dataset(options.data.data, options.data.over(dataset_options(source), all));
  }
  const TraceOptions own = trace_options(source);
  const TraceOptions trace = options.trace.over(own);
  const std::vector<View> views = views_of(options, dataset);
  const std::vector<Camera> cameras = cameras_of(options, views, source);
  view::ViewState state = view::first_look(scene_extent(gaussians), cameras, up_of(options));
  state.about = fmt::format("{} Gaussians, SH degree {}", gaussians.size(), gaussians.sh_degree);
  const bool has_photos = !options.data.data.empty() && options.cameras.empty();
  if (options.cameras.empty() && !has_photos && !cameras.empty())
    state.about += "; --data DATASET adds the photos of its cameras";
  state.origin = {source.origin[0], source.origin[1], source.origin[2]};
  const Mirrors mirrors = mirrors_of(source);
  const std::unique_ptr<Context> context = open_context(options.device);
  const Model model(*context, gaussians);
  const glm::dvec3 above = state.up;
  const auto pictures =
      view::pictures_with_meshes(*context, view::model_pictures(*context, model, trace, mirrors),
                                 [&] { return scene_of(gaussians, trace, above); });
  view::DroppedMeshes meshes([&](const std::vector<Mesh>& shown) { pictures->set_meshes(shown); },
                             scene_head(source), scene_tail(own, trace, above));
  state.has_near = mirrors.meshes.empty();
  state.near_depth = trace.near_depth;
  state.has_order = true;
  view::Photos photos(views, trace.background);
  // Mirrors that a model was trained with are no part of a scene.
  serve(options, *pictures, std::move(state), mirrors.meshes.empty() ? &meshes : nullptr,
        has_photos ? &photos : nullptr);
}

void check(const Options& options) {
  options.data.check_used(false);
  if (const std::optional<glm::dvec3> up = up_of(options)) check_up(*up);
  if (options.data.data.empty() && options.data.settings.has("downscale"))
    throw UsageError("--downscale divides the sizes of photos: add --data DATASET");
}

void run(const Options& options) {
  check(options);
  if (is_scene_file(options.model)) {
    if (!options.data.data.empty() || !options.cameras.empty()) {
      throw UsageError("--data and --cameras are for models: a scene file has its own [camera]");
    }
    if (options.trace.has("near")) {
      throw UsageError(
          "--near is for models: rays that leave a mirror have no camera that could be near");
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
  add_model_argument(*command, options->model, true);
  add_data_flags(*command, options->data, "test, train or all (default)");
  command
      ->add_option("--cameras", options->cameras,
                   "Cameras of a transforms.json or cameras.json, for the page's list")
      ->type_name("FILE");
  add_viewer_flags(*command, options->viewer);
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
