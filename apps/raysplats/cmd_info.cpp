// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "commands.hpp"
#include "info_dataset.hpp"
#include "info_file.hpp"
#include "info_model.hpp"
#include "info_parts.hpp"
#include "info_scene.hpp"
#include "io/dataset/colmap_model.hpp"
#include "io/dataset/dataset_advice.hpp"
#include "io/model/model_file.hpp"
#include "io/scene/scene_file.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "run/model_source.hpp"
#include "util/file_kind.hpp"
#include "util/json_text.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

struct Options {
  std::string path;
  bool json = false;
  DataSettings data;
};

/// Keys in alphabetical order.
void print_json(const nlohmann::json& json) { fmt::print("{}\n", json_text(json, 2)); }

/// A folder that is neither a run nor a data set may hold models.
void check_folder(const std::filesystem::path& folder) {
  const std::vector<std::string> models = models_in(folder);
  if (models.empty() || io::looks_like_dataset(folder) || io::find_colmap_model(folder)) return;
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
  if (!is_there(path)) {
    throw DataError(
        fmt::format("{} does not exist: name a model, a mesh, a scene file, a data set or a run",
                    path.string()));
  }
  const bool folder = is_folder(path);
  std::optional<Json> other;
  if (!folder) {
    other = describe_file(path);
  } else if (!is_model_folder(path)) {
    other = describe_colmap(path);
  }
  const bool is_dataset = folder && !other && !is_model_folder(path);
  for (const char* flag : kPhotoFlags) {
    if (is_dataset || !options.data.has(flag)) continue;
    throw UsageError(
        fmt::format("--{} is about the photos of a data set, and {} is none", flag, options.path));
  }
  if (other) {
    (*other)["path"] = options.path;
    options.json ? print_json(*other) : print_file(*other);
  } else if (is_dataset) {
    check_folder(path);
    const Json dataset = describe_dataset(path, options.data.over({}));
    options.json ? print_json(dataset) : print_dataset(dataset);
  } else if (!folder && is_scene_file(path)) {
    const Json scene = describe_scene(path);
    options.json ? print_json(scene) : print_scene(scene);
  } else if (!folder && is_mesh(path)) {
    const Json mesh = describe_mesh(path);
    options.json ? print_json(mesh) : print_mesh(mesh);
  } else {
    if (!folder) check_known(path);
    options.json ? print_json(describe_model(path)) : print_model(path);
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
  add_photo_flags(*command, options->data);
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
