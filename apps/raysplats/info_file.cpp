// SPDX-License-Identifier: Apache-2.0
#include "info_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "info_parts.hpp"
#include "io/byte_reader.hpp"
#include "io/dataset/camera_list.hpp"
#include "io/image/image_file.hpp"
#include "io/json_file.hpp"
#include "io/npy_file.hpp"
#include "io/scene/camera_path_file.hpp"
#include "io/toml_table.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "report/run_files.hpp"
#include "run/checkpoint.hpp"
#include "run/train_config.hpp"
#include "util/path_text.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

Json describe_path(const std::filesystem::path& path) {
  const CameraPathFile file = read_camera_path(path, {});
  Json out{{"type", "camera path"},
           {"frames", file.cameras.size()},
           {"fps", file.fps},
           {"closed", file.closed}};
  out.update(describe_cameras(file.cameras));
  out.erase("cameras");
  return out;
}

/// cameras.json of a run, which viewers of 3DGS read.
Json describe_views(const std::filesystem::path& path) {
  Json out{{"type", "cameras of viewers"}};
  out.update(describe_cameras(io::read_listed_views(path)));
  return out;
}

std::optional<Json> describe_json(const std::filesystem::path& path) {
  if (io::is_camera_list(path)) return describe_views(path);
  const nlohmann::json json = io::parse_json_object(io::read_file(path), path);
  if (json.contains("camera_path") || json.contains("keyframes")) return describe_path(path);
  if (!json.contains("frames")) return describe_record(json, path);
  Json out{{"type", "cameras"}};
  out.update(describe_cameras(read_cameras(path)));
  return out;
}

/// metrics.csv of a run.
std::optional<Json> describe_curves(const std::filesystem::path& path) {
  const std::map<std::string, std::vector<double>> columns = report::columns_of(path);
  const auto iterations = columns.find("iteration");
  if (iterations == columns.end()) return std::nullopt;
  const std::vector<double>& rows = iterations->second;
  constexpr double kExact = 9007199254740992.0;  // 2^53, beyond any run
  const double last = rows.empty() ? 0.0 : std::clamp(rows.back(), 0.0, kExact);
  Json out{{"type", "course of a run"},
           {"rows", rows.size()},
           {"iterations", static_cast<std::int64_t>(last)}};
  for (const auto& [name, values] : columns) out["columns"].push_back(name);
  return out;
}

Json describe_array(const std::filesystem::path& path) {
  const io::NpyArray array = io::read_npy(path);
  const std::size_t last = array.shape.empty() ? 0 : array.shape.back();
  float low = std::numeric_limits<float>::infinity();
  float high = -low;
  std::size_t odd = 0;
  for (const float value : array.data) {
    if (std::isfinite(value)) {
      low = std::min(low, value);
      high = std::max(high, value);
    } else {
      ++odd;
    }
  }
  const bool rays = array.shape.size() > 1 && (last == 6 || last == 8);
  Json out{{"type", rays ? "rays" : "array"}, {"shape", array.shape}};
  if (rays) {
    out["rays"] = array.data.size() / last;
    out["limits"] = last == 8;
  }
  if (low <= high) out["range"] = {low, high};
  out["not_finite"] = odd;
  return out;
}

Json describe_picture(const std::filesystem::path& path) {
  const io::ImageSize size = io::image_size(path);
  return {{"type", "picture"},
          {"width", size.width},
          {"height", size.height},
          {"bytes_per_number", size.sample_bytes}};
}

Json describe_checkpoint(const std::filesystem::path& path) {
  const Checkpoint checkpoint = read_checkpoint(path);
  return {{"type", "checkpoint"},
          {"iteration", checkpoint.iteration},
          {"iterations", parse_train_config(checkpoint.config).iterations},
          {"gaussians", checkpoint.count},
          {"sh_degree", checkpoint.sh_degree},
          {"seed", checkpoint.seed}};
}

/// Scene files are described elsewhere.
std::optional<Json> describe_toml(const std::filesystem::path& path) {
  const toml::table table = io::read_toml(path);
  if (table.contains("key")) return describe_path(path);
  for (const char* part : {"model", "mesh", "camera", "light", "material", "environment", "render"})
    if (table.contains(part)) return std::nullopt;
  TrainOptions options;
  read_train_config(path, options);
  std::vector<std::string> given;
  for (const auto& [key, value] : table) {
    if (!value.is_table()) given.emplace_back(key.str());
  }
  if (const toml::table* nested = table["train"].as_table(); nested != nullptr) {
    for (const auto& [key, value] : *nested) given.emplace_back(key.str());
  }
  Json about{{"type", "configuration"}};
  if (options.iterations != kFittedLength) about["iterations"] = options.iterations;
  about["given"] = given;
  return about;
}

}  // namespace

const char* model_name(CameraModel model) {
  switch (model) {
    case CameraModel::kOpenCv:
      return "opencv";
    case CameraModel::kFisheye:
      return "fisheye";
    case CameraModel::kEquirectangular:
      return "equirectangular";
    case CameraModel::kOrthographic:
      return "orthographic";
    case CameraModel::kPhotoLens:
      return "of photos alone";
    case CameraModel::kPinhole:
      break;
  }
  return "pinhole";
}

Json describe_cameras(std::span<const Camera> cameras) {
  std::map<std::pair<int, int>, std::size_t> sizes;
  std::map<std::string, std::size_t> models;
  for (const Camera& camera : cameras) {
    ++sizes[{camera.width, camera.height}];
    ++models[model_name(camera.model)];
  }
  Json out{
      {"cameras", cameras.size()}, {"sizes", Json::array()}, {"camera_models", Json::object()}};
  for (const auto& [size, count] : sizes) {
    out["sizes"].push_back({{"width", size.first}, {"height", size.second}, {"cameras", count}});
  }
  for (const auto& [name, count] : models) out["camera_models"][name] = count;
  return out;
}

Json bounds_of(std::span<const float> positions) {
  std::array<float, 3> low{}, high{};
  for (std::size_t i = 0; i < positions.size(); ++i) {
    low[i % 3] = i < 3 ? positions[i] : std::min(low[i % 3], positions[i]);
    high[i % 3] = i < 3 ? positions[i] : std::max(high[i % 3], positions[i]);
  }
  return {low, high};
}

const char* material_kind(Material::Kind kind) {
  switch (kind) {
    case Material::Kind::kMirror:
      return "mirror";
    case Material::Kind::kGlass:
      return "glass";
    case Material::Kind::kTransparent:
      return "transparent";
    case Material::Kind::kEmissive:
      return "emissive";
    case Material::Kind::kDiffuse:
      break;
  }
  return "diffuse";
}

std::optional<Json> describe_file(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  // meta.json is a model of SOG.
  if (extension == ".json" && path.filename() != "meta.json") return describe_json(path);
  if (extension == ".npy") return describe_array(path);
  if (extension == ".npz") {
    throw DataError(
        fmt::format("{} holds arrays, as trace writes them, which info does not read: open it with "
                    "numpy.load()",
                    path.string()));
  }
  if (extension == ".csv") return describe_curves(path);
  if (extension == ".rsck") return describe_checkpoint(path);
  if (extension == ".toml") return describe_toml(path);
  if (extension == ".ply") return describe_points(path);
  if (extension == ".mtl") return describe_materials(path);
  if (extension == ".onnx") return describe_network(path);
  if (io::has_image_extension(path)) return describe_picture(path);
  return describe_colmap(path);
}

void print_file(const Json& file) {
  for (const auto& [key, value] : file.items()) {
    if (key == "path") continue;
    std::string name = key;
    std::replace(name.begin(), name.end(), '_', ' ');
    std::string text;
    if (key == "sizes") {
      for (const Json& size : value) {
        text += fmt::format("{}{}x{} ({})", text.empty() ? "" : ", ", size["width"].get<int>(),
                            size["height"].get<int>(), size["cameras"].get<std::size_t>());
      }
    } else if (value.is_array() || value.is_object()) {
      for (const auto& [part, entry] : value.items()) {
        const std::string said = entry.is_string() ? entry.get<std::string>() : entry.dump();
        if (!text.empty()) text += ", ";
        if (value.is_object()) text += part + ' ';
        text += said;
      }
    } else if (value.is_boolean()) {
      text = value.get<bool>() ? "yes" : "no";
    } else {
      text = value.is_string() ? value.get<std::string>() : value.dump();
    }
    fmt::print("{:<16} {}\n", name, text);
  }
}

}  // namespace raysplats::cli
