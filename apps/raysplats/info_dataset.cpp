// SPDX-License-Identifier: Apache-2.0
#include "info_dataset.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "info_file.hpp"
#include "util/number_text.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

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
          {"borders", std::count_if(dataset.views.begin(), dataset.views.end(),
                                    [](const View& view) { return view.border != nullptr; })},
          {"ignored_areas", dataset.views.empty() ? 0 : dataset.views.front().ignored.size()},
          {"points", dataset.points.size()}};
}

}  // namespace

Json describe_dataset(const std::filesystem::path& path, const DatasetOptions& options) {
  Json out{{"type", "dataset"}, {"path", path.string()}};
  out.update(describe(load_dataset(path, options)));
  return out;
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
  if (const auto borders = dataset["borders"].get<std::size_t>(); borders > 0) {
    fmt::print("black borders    {}: the same in all photos of a size, and do not count\n",
               counted(borders, "photo"));
  }
  if (const auto areas = dataset["ignored_areas"].get<std::size_t>(); areas > 0) {
    fmt::print("ignored areas    {}: of all photos, and do not count\n", areas);
  }
  if (dataset["alpha_is_background"].get<bool>()) {
    fmt::print("transparency     photos are cut out: what is transparent is background\n");
  }
  fmt::print("points           {}\n", dataset["points"].get<std::size_t>());
}

}  // namespace raysplats::cli
