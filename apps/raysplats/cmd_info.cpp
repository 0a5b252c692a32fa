// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "info_files.hpp"
#include "info_parts.hpp"
#include "io/colmap_model.hpp"
#include "io/json_file.hpp"
#include "io/mesh_file.hpp"
#include "io/model_file.hpp"
#include "io/model_formats.hpp"
#include "io/ply_file.hpp"
#include "io/scene_file.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "render_flags.hpp"
#include "run/model_source.hpp"
#include "scene/model_summary.hpp"
#include "scene/trace_rows.hpp"
#include "util/number_text.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string path;
  bool json = false;
};

Json describe(const ModelSummary& model) {
  return {{"gaussians", model.count},
          {"sh_degree", model.sh_degree},
          {"bounds", {model.minimum, model.maximum}},
          {"bounds_98_percent", {model.inner_minimum, model.inner_maximum}},
          {"scale_quantiles", model.scale_quantiles},
          {"median_anisotropy", model.median_anisotropy},
          {"mean_opacity", model.mean_opacity},
          {"opacity_histogram", model.opacity_histogram}};
}

const char* kind_name(DatasetKind kind) {
  switch (kind) {
    case DatasetKind::kColmap:
      return "COLMAP";
    case DatasetKind::kBlender:
      return "Blender";
    case DatasetKind::kLlff:
      return "LLFF";
    case DatasetKind::kPolycam:
      return "Polycam";
    case DatasetKind::kNerfstudio:
      break;
  }
  return "nerfstudio";
}

const char* kind_name(Light::Kind kind) {
  switch (kind) {
    case Light::Kind::kDirectional:
      return "directional";
    case Light::Kind::kSphere:
      return "sphere";
    case Light::Kind::kPoint:
      break;
  }
  return "point";
}

const char* source_name(SceneCamera::Source source) {
  switch (source) {
    case SceneCamera::Source::kPlaced:
      return "placed";
    case SceneCamera::Source::kFile:
      return "file";
    case SceneCamera::Source::kData:
      return "data set";
    case SceneCamera::Source::kOrbit:
      return "orbit";
    case SceneCamera::Source::kGiven:
    case SceneCamera::Source::kNone:
      break;
  }
  return "none";
}

Json describe(const TraceOptions& trace) {
  return {{"hit_order", hit_order_name(trace.hit_order)},
          {"quantile", trace.quantile},
          {"adaptive_radius", trace.adaptive_radius},
          {"near_depth", trace.near_depth},
          {"min_transmittance", trace.min_transmittance},
          {"max_hits", trace.max_hits},
          {"background", trace.background}};
}

Json describe(const io::MeshFile& file) {
  std::array<float, 3> low{}, high{};
  for (std::size_t i = 0; i < file.mesh.positions.size(); ++i) {
    const float x = file.mesh.positions[i];
    low[i % 3] = i < 3 ? x : std::min(low[i % 3], x);
    high[i % 3] = i < 3 ? x : std::max(high[i % 3], x);
  }
  Json materials = Json::array();
  for (const Material& material : file.materials) {
    materials.push_back({{"name", material.name}, {"kind", material_kind(material.kind)}});
  }
  return {{"triangles", file.mesh.triangle_count()},
          {"vertices", file.mesh.vertex_count()},
          {"bounds", {low, high}},
          {"normals", !file.mesh.normals.empty()},
          {"texture_coordinates", !file.mesh.uvs.empty()},
          {"textures", file.textures.size()},
          {"materials", materials}};
}

Json describe(const SceneFile& scene) {
  Json models = Json::array(), meshes = Json::array(), materials = Json::array();
  Json lights = Json::array();
  for (const SceneModel& model : scene.models) models.push_back(model.file.string());
  for (const SceneMesh& mesh : scene.meshes) {
    meshes.push_back({{"file", mesh.file.string()}, {"moves", mesh.moves()}});
  }
  for (const SceneMaterial& each : scene.materials) {
    materials.push_back(
        {{"name", each.material.name}, {"kind", material_kind(each.material.kind)}});
  }
  for (const Light& light : scene.lights) lights.push_back(kind_name(light.kind));
  Json camera{{"source", source_name(scene.camera.source)},
              {"model", model_name(scene.camera.model)}};
  if (!scene.camera.file.empty()) camera["file"] = scene.camera.file.string();
  if (scene.camera.frames) camera["frames"] = *scene.camera.frames;
  Json out{{"models", models},
           {"meshes", meshes},
           {"materials", materials},
           {"lights", lights},
           {"camera", camera},
           {"samples", scene.render.samples},
           {"max_bounces", scene.render.max_bounces}};
  if (scene.frames) out["animation_frames"] = *scene.frames;
  return out;
}

Json describe(const Dataset& dataset) {
  std::map<std::pair<int, int>, std::size_t> sizes;
  for (const View& view : dataset.views) ++sizes[{view.camera.width, view.camera.height}];
  Json size_list = Json::array();
  for (const auto& [size, count] : sizes) {
    size_list.push_back({{"width", size.first}, {"height", size.second}, {"views", count}});
  }
  const auto has_lens = [](const View& view) {
    return view.source_camera.distortion.any() ||
           view.source_camera.model == CameraModel::kPhotoLens;
  };
  const bool distorted = std::any_of(dataset.views.begin(), dataset.views.end(), has_lens);
  // Loading leaves the lenses that it cannot take out.
  const bool undistorted = std::any_of(
      dataset.views.begin(), dataset.views.end(),
      [&](const View& view) { return has_lens(view) && !view.camera.distortion.any(); });
  std::map<std::string, std::size_t> models;
  for (const View& view : dataset.views) ++models[model_name(view.camera.model)];
  Json model_list = Json::object();
  for (const auto& [name, count] : models) model_list[name] = count;
  return {{"kind", kind_name(dataset.kind)},
          {"views", dataset.views.size()},
          {"train_views", dataset.indices(Split::kTrain).size()},
          {"test_views", dataset.indices(Split::kTest).size()},
          {"sizes", size_list},
          {"camera_models", model_list},
          {"distorted", distorted},
          {"undistorted_when_loaded", undistorted},
          {"alpha_is_background", dataset.alpha_is_background},
          {"masks", std::count_if(dataset.views.begin(), dataset.views.end(),
                                  [](const View& view) { return !view.mask_path.empty(); })},
          {"points", dataset.points.size()}};
}

void print(const ModelSummary& model) {
  const auto vector = [](const std::array<double, 3>& v) {
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0], v[1], v[2]);
  };
  const auto& q = model.scale_quantiles;
  fmt::print("Gaussians        {}, SH degree {}\n", model.count, model.sh_degree);
  if (model.count == 0) return;
  fmt::print("bounds           {} to {}\n", vector(model.minimum), vector(model.maximum));
  fmt::print("98 % of them     {} to {}\n", vector(model.inner_minimum),
             vector(model.inner_maximum));
  fmt::print(
      "scales           {:.3g} least, {:.3g} at 5 %, {:.3g} median, {:.3g} at 95 %, {:.3g} most\n",
      q[0], q[1], q[2], q[3], q[4]);
  fmt::print("anisotropy       {:.3g} median of largest over smallest scale\n",
             model.median_anisotropy);
  fmt::print("opacity          {:.3f} mean\n", model.mean_opacity);
  const std::size_t bins = model.opacity_histogram.size();
  const std::size_t most =
      *std::max_element(model.opacity_histogram.begin(), model.opacity_histogram.end());
  for (std::size_t k = 0; k < bins; ++k) {
    const std::size_t count = model.opacity_histogram[k];
    fmt::print("  {:.1f} to {:.1f}     {:>9} {}\n",
               static_cast<double>(k) / static_cast<double>(bins),
               static_cast<double>(k + 1) / static_cast<double>(bins), count,
               std::string(40 * count / most, '#'));
  }
}

void print_dataset(const Json& dataset) {
  const char* lenses = "";
  if (dataset["undistorted_when_loaded"].get<bool>()) {
    lenses = ", lens distortion (undistorted when loaded)";
  } else if (dataset["distorted"].get<bool>()) {
    lenses = ", lens distortion (photos are kept as they are)";
  }
  fmt::print("data set         {}{}\n", dataset["kind"].get<std::string>(), lenses);
  for (const auto& [name, count] : dataset["camera_models"].items()) {
    fmt::print("cameras          {} ({})\n", name, counted(count.get<std::size_t>(), "view"));
  }
  fmt::print("views            {}: {} to train, {} to test\n", dataset["views"].get<std::size_t>(),
             dataset["train_views"].get<std::size_t>(), dataset["test_views"].get<std::size_t>());
  for (const Json& size : dataset["sizes"]) {
    fmt::print("size             {}x{} ({})\n", size["width"].get<int>(), size["height"].get<int>(),
               counted(size["views"].get<std::size_t>(), "view"));
  }
  if (const auto masks = dataset["masks"].get<std::size_t>(); masks > 0) {
    fmt::print("masks            {}: what is black there does not count\n", masks);
  }
  if (dataset["alpha_is_background"].get<bool>()) {
    fmt::print("transparency     photos are cut out: what is transparent is background\n");
  }
  fmt::print("points           {}\n", dataset["points"].get<std::size_t>());
}

std::string named_kinds(const Json& materials) {
  std::vector<std::string> parts;
  for (const Json& material : materials) {
    const std::string name = material["name"];
    parts.push_back(fmt::format("{} ({})", name.empty() ? "unnamed" : name,
                                material["kind"].get<std::string>()));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

void print_mesh(const Json& mesh) {
  const auto corner = [&](std::size_t i) {
    const Json& v = mesh["bounds"][i];
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0].get<float>(), v[1].get<float>(),
                       v[2].get<float>());
  };
  fmt::print("mesh             {}, {}\n", counted(mesh["triangles"].get<std::size_t>(), "triangle"),
             counted(mesh["vertices"].get<std::size_t>(), "vertex", "vertices"));
  fmt::print("bounds           {} to {}\n", corner(0), corner(1));
  fmt::print("normals          {}\n", mesh["normals"].get<bool>() ? "of the file" : "none: flat");
  fmt::print("texture          {}, {} coordinates\n",
             counted(mesh["textures"].get<std::size_t>(), "picture"),
             mesh["texture_coordinates"].get<bool>() ? "with" : "without");
  fmt::print("materials        {}\n", named_kinds(mesh["materials"]));
}

void print_scene(const Json& scene) {
  for (const Json& model : scene["models"]) {
    fmt::print("model            {}\n", model.get<std::string>());
  }
  for (const Json& mesh : scene["meshes"]) {
    fmt::print("mesh             {}{}\n", mesh["file"].get<std::string>(),
               mesh["moves"].get<bool>() ? " (moves)" : "");
  }
  if (!scene["materials"].empty()) {
    fmt::print("materials        {}\n", named_kinds(scene["materials"]));
  }
  fmt::print(
      "lights           {}\n",
      scene["lights"].empty()
          ? "none"
          : fmt::format("{}", fmt::join(scene["lights"].get<std::vector<std::string>>(), ", ")));
  const Json& camera = scene["camera"];
  fmt::print("camera           {}, {}{}\n", camera["source"].get<std::string>(),
             camera["model"].get<std::string>(),
             camera.contains("frames")
                 ? ", " + counted(camera["frames"].get<std::size_t>(), "frame")
                 : "");
  if (scene.contains("animation_frames")) {
    fmt::print("animation        {}\n",
               counted(scene["animation_frames"].get<std::size_t>(), "frame"));
  }
  fmt::print("samples          {} a pixel, {} at most\n", scene["samples"].get<int>(),
             counted(scene["max_bounces"].get<std::size_t>(), "bounce"));
}

void print_json(const Json& json) { fmt::print("{}\n", io::json_text(json, 2)); }

void info_model(const Options& options) {
  const ModelSource source = find_model(options.path);
  const ModelSummary summary = summarize(read_model(source.file));
  const bool run = is_run_folder(options.path);
  if (options.json) {
    Json json{
        {"type", run ? "run" : "model"}, {"path", options.path}, {"model", source.file.string()}};
    if (source.iteration) json["iteration"] = *source.iteration;
    if (source.trained) json["iterations"] = source.trained->iterations;
    if (source.header) json["trace"] = describe(*source.header);
    if (!source.sky.empty()) json["sky"] = source.sky;
    if (source.origin != std::array<double, 3>{}) json["origin"] = source.origin;
    json.update(describe(summary));
    print_json(json);
    return;
  }
  if (run) {
    fmt::print("run              {}\n", options.path);
    fmt::print("model            {}\n", source.file.string());
    if (source.trained)
      fmt::print("trained          {} of {} iterations\n", *source.iteration,
                 source.trained->iterations);
  }
  print(summary);
  if (source.header) {
    fmt::print("traced           in {} order, quantile {:.4g}, {} radius\n",
               hit_order_name(source.header->hit_order), source.header->quantile,
               source.header->adaptive_radius ? "adaptive" : "whole");
    if (source.sky.empty())
      fmt::print("background       {}\n", fmt::join(source.header->background, ", "));
  }
  if (!source.sky.empty()) {
    fmt::print("sky              trained, by direction, {} coefficients a channel\n",
               source.sky.size());
  }
  if (source.origin != std::array<double, 3>{}) {
    fmt::print("origin           {}, {}, {}: positions count from there\n", source.origin[0],
               source.origin[1], source.origin[2]);
  }
}

// A PLY with faces and without opacities.
bool is_mesh_ply(const std::filesystem::path& path) {
  const io::PlyFile file(path);
  constexpr std::array<std::string_view, 2> kCorners{"vertex_indices", "vertex_index"};
  return !file.column("opacity") &&
         file.for_each_list("face", kCorners, [](std::size_t, std::span<const double>) {});
}

bool is_mesh(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  if (extension == ".ply") return is_mesh_ply(path);
  if (extension == ".gltf" || extension == ".glb") return !io::has_gltf_gaussians(path);
  return extension == ".obj";
}

void info_mesh(const Options& options) {
  Json json{{"type", "mesh"}, {"path", options.path}};
  json.update(describe(io::read_mesh(options.path)));
  if (options.json) {
    print_json(json);
  } else {
    print_mesh(json);
  }
}

void info_scene(const Options& options) {
  Json json{{"type", "scene"}, {"path", options.path}};
  json.update(describe(read_scene_file(options.path)));
  if (options.json) {
    print_json(json);
  } else {
    print_scene(json);
  }
}

void info_file(const Options& options, const Json& described) {
  Json json = described;
  json["path"] = options.path;
  if (options.json) {
    print_json(json);
  } else {
    print_file(json);
  }
}

void info_dataset(const Options& options) {
  const Dataset dataset = load_dataset(options.path);
  Json json{{"type", "dataset"}, {"path", options.path}};
  json.update(describe(dataset));
  if (options.json) {
    print_json(json);
  } else {
    print_dataset(json);
  }
}

bool is_dataset(const std::filesystem::path& folder) {
  std::error_code error;
  return io::find_colmap_model(folder) ||
         std::filesystem::exists(folder / "transforms.json", error) ||
         std::filesystem::exists(folder / "transforms_train.json", error);
}

/// A folder that is neither a run nor a data set may hold models.
void check_folder(const std::filesystem::path& folder) {
  const std::vector<std::string> models = models_in(folder);
  if (models.empty() || is_dataset(folder)) return;
  throw DataError(fmt::format("{} is neither a run nor a data set: name a file in it, such as {}",
                              folder.string(), fmt::join(models, ", ")));
}

void check_known(const std::filesystem::path& file) {
  if (io::model_format(file) != io::ModelFormat::kUnknown) return;
  throw DataError(fmt::format(
      "{} is nothing that info reads: those are models (PLY, .splat, SPZ, SOG, glTF), meshes (PLY, "
      "OBJ, glTF, .mtl), scene files, data sets, runs, COLMAP models, cameras, camera paths, "
      "arrays (.npy), pictures, checkpoints, configurations (.toml), networks (.onnx), the JSON of "
      "runs, evaluations and benchmarks, and the course of runs (metrics.csv)",
      file.string()));
}

void run(const Options& options) {
  const std::filesystem::path path = options.path;
  if (!std::filesystem::exists(path)) {
    throw DataError(
        fmt::format("{} does not exist: name a model, a mesh, a scene file, a data set or a run",
                    path.string()));
  }
  const bool folder = std::filesystem::is_directory(path);
  std::optional<Json> other;
  if (!folder) {
    other = describe_file(path);
  } else if (!is_model_folder(path)) {
    other = describe_colmap(path);
  }
  if (other) {
    info_file(options, *other);
  } else if (folder && !is_model_folder(path)) {
    check_folder(path);
    info_dataset(options);
  } else if (!folder && is_scene_file(options.path)) {
    info_scene(options);
  } else if (!folder && is_mesh(path)) {
    info_mesh(options);
  } else {
    if (!folder) check_known(path);
    info_model(options);
  }
}

}  // namespace

Command add_info_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand(
      "info",
      "Describe a model, a data set, a training run, or another file that is read or written");
  auto options = std::make_shared<Options>();
  command
      ->add_option("PATH", options->path,
                   "Model (PLY, .splat, SPZ, SOG, glTF), mesh, .mtl, scene file, data set, COLMAP "
                   "model or run folder; points (PLY), cameras, camera path, rays (.npy), picture, "
                   "checkpoint, configuration, network (.onnx), metrics, exposures or benchmark")
      ->required()
      ->type_name("");
  command->add_flag("--json", options->json, "Print JSON");
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
