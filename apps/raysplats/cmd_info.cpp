// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/model_summary.hpp"
#include "options.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "train/model_source.hpp"

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
    case DatasetKind::kNerfstudio:
      break;
  }
  return "nerfstudio";
}

Json describe(const Dataset& dataset) {
  std::map<std::pair<int, int>, std::size_t> sizes;
  for (const View& view : dataset.views) ++sizes[{view.camera.width, view.camera.height}];
  Json size_list = Json::array();
  for (const auto& [size, count] : sizes) {
    size_list.push_back({{"width", size.first}, {"height", size.second}, {"views", count}});
  }
  const bool distorted =
      std::any_of(dataset.views.begin(), dataset.views.end(),
                  [](const View& view) { return view.source_camera.distortion.any(); });
  return {{"kind", kind_name(dataset.kind)},
          {"views", dataset.views.size()},
          {"train_views", dataset.indices(Split::kTrain).size()},
          {"test_views", dataset.indices(Split::kTest).size()},
          {"sizes", size_list},
          {"distorted", distorted},
          {"alpha_is_background", dataset.alpha_is_background},
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
  fmt::print("data set         {}{}\n", dataset["kind"].get<std::string>(),
             dataset["distorted"].get<bool>() ? ", lens distortion (undistorted when loaded)" : "");
  fmt::print("views            {}: {} to train, {} to test\n", dataset["views"].get<std::size_t>(),
             dataset["train_views"].get<std::size_t>(), dataset["test_views"].get<std::size_t>());
  for (const Json& size : dataset["sizes"]) {
    fmt::print("size             {}x{} ({} views)\n", size["width"].get<int>(),
               size["height"].get<int>(), size["views"].get<std::size_t>());
  }
  fmt::print("points           {}\n", dataset["points"].get<std::size_t>());
}

void print_json(const Json& json) {
  fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
}

void info_model(const Options& options) {
  const ModelSource source = find_model(options.path);
  const ModelSummary summary = summarize(read_ply(source.ply));
  const bool run = std::filesystem::is_directory(options.path);
  if (options.json) {
    Json json{
        {"type", run ? "run" : "model"}, {"path", options.path}, {"model", source.ply.string()}};
    if (source.iteration) json["iteration"] = *source.iteration;
    if (source.trained) json["iterations"] = source.trained->iterations;
    json.update(describe(summary));
    print_json(json);
    return;
  }
  if (run) {
    fmt::print("run              {}\n", options.path);
    fmt::print("model            {}\n", source.ply.string());
    if (source.trained)
      fmt::print("trained          {} of {} iterations\n", *source.iteration,
                 source.trained->iterations);
  }
  print(summary);
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

void run(const Options& options) {
  const std::filesystem::path path = options.path;
  if (!std::filesystem::exists(path)) {
    throw DataError(
        fmt::format("{} does not exist: name a PLY, a data set or a run", path.string()));
  }
  if (std::filesystem::is_directory(path) && !is_run_folder(path)) {
    info_dataset(options);
  } else {
    info_model(options);
  }
}

}  // namespace

Command add_info_command(CLI::App& app) {
  CLI::App* command = app.add_subcommand("info", "Describe a model, a data set or a training run");
  auto options = std::make_shared<Options>();
  command->add_option("PATH", options->path, "3DGS PLY, data set or run folder")
      ->required()
      ->type_name("");
  command->add_flag("--json", options->json, "Print JSON");
  return {command, [options] { run(*options); }};
}

}  // namespace raysplats::cli
