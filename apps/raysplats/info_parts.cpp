// SPDX-License-Identifier: Apache-2.0
#include "info_parts.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "bench/report.hpp"
#include "info_file.hpp"
#include "io/dataset/colmap_model.hpp"
#include "io/dataset/ply_points.hpp"
#include "io/mesh/mtl_materials.hpp"
#include "io/ply_file.hpp"
#include "raysplats/lpips.hpp"
#include "report/run_files.hpp"
#include "util/file_kind.hpp"

namespace raysplats::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

/// The folder of photos stands beside a model that lies in a data set's own folder.
bool has_photos(const fs::path& folder, const io::ColmapModel& model) {
  for (const char* name : {"images", "images_2", "images_4", "images_8"})
    if (is_folder(folder / name)) return true;
  return !model.images.empty() && is_file(folder / model.images.front().name);
}

bool is_matrix(const nlohmann::json& json, std::size_t rows, std::size_t columns) {
  const auto is_row = [&](const nlohmann::json& row) {
    return row.is_array() && row.size() == columns &&
           std::all_of(row.begin(), row.end(), [](const auto& each) { return each.is_number(); });
  };
  return json.is_array() && json.size() == rows && std::all_of(json.begin(), json.end(), is_row);
}

/// Copies what is a number, a text or a truth of these members.
void copy_plain(const nlohmann::json& from, std::initializer_list<const char*> names, Json& to) {
  for (const char* name : names) {
    const auto found = from.find(name);
    if (found != from.end() && found->is_primitive() && !found->is_null()) to[name] = *found;
  }
}

Json describe_benchmark(const fs::path& path) {
  const BenchReport report = read_bench_report(path);
  Json rows = Json::array();
  for (const BenchRow& row : report.rows) rows.push_back(row.id());
  return {{"type", "benchmark"},     {"version", report.version}, {"date", report.date},
          {"device", report.device}, {"driver", report.driver},   {"rows", rows}};
}

Json describe_tuning(const nlohmann::json& json) {
  Json devices = Json::array();
  for (const nlohmann::json& each : json.value("devices", nlohmann::json::array()))
    if (each.is_object() && each.contains("device")) devices.push_back(Json(each["device"]));
  return {{"type", "tuning"}, {"devices", devices}};
}

}  // namespace

std::optional<Json> describe_points(const fs::path& path) {
  const io::PlyFile file(path);
  constexpr std::array<std::string_view, 4> kOfGaussians{"opacity", "f_dc_0", "scale_0", "rot_0"};
  const bool gaussians =
      std::any_of(kOfGaussians.begin(), kOfGaussians.end(),
                  [&](std::string_view name) { return file.column(name).has_value(); });
  if (gaussians || file.later_rows("face") > 0 || !file.column("x")) return std::nullopt;
  const io::PlyPoints points = io::read_ply_points(path);
  return Json{{"type", "points"},
              {"points", points.cloud.size()},
              {"bounds", bounds_of(points.cloud.positions)},
              {"colours", points.colored}};
}

std::optional<Json> describe_colmap(const fs::path& path) {
  constexpr std::array<std::string_view, 3> kParts{"cameras", "images", "points3D"};
  const std::string extension = path.extension().string(), stem = path.stem().string();
  const bool whole = is_folder(path);
  const bool part = (extension == ".bin" || extension == ".txt") &&
                    std::find(kParts.begin(), kParts.end(), stem) != kParts.end();
  std::error_code error;
  const fs::path folder = whole ? path : fs::absolute(path, error).parent_path();
  if ((!whole && !part) || (!is_file(folder / "cameras.bin") && !is_file(folder / "cameras.txt")))
    return std::nullopt;
  const io::ColmapModel model = io::read_colmap_model(folder);
  if (whole && has_photos(folder, model)) return std::nullopt;
  std::vector<Camera> cameras;
  cameras.reserve(model.images.size());
  for (const io::ColmapImage& image : model.images)
    cameras.push_back(model.cameras.at(image.camera_id));
  Json out{{"type", "COLMAP model"}, {"lenses", model.cameras.size()}};
  out.update(describe_cameras(cameras));
  out["points"] = model.points.size();
  if (model.points.size() > 0) out["bounds"] = bounds_of(model.points.positions);
  return out;
}

Json describe_materials(const fs::path& path) {
  // Of an OBJ file that would lie beside it.
  io::MtlMaterials library(path.parent_path() / "any.obj");
  library.add_library(path.filename().string());
  library.use_all();
  Json materials = Json::object();
  for (const Material& each : library.materials) materials[each.name] = material_kind(each.kind);
  return {{"type", "materials"}, {"materials", materials}, {"textures", library.textures.size()}};
}

Json describe_network(const fs::path& path) {
  const Lpips network(path);
  return {{"type", "network of LPIPS"}, {"bytes", fs::file_size(path)}};
}

std::optional<Json> describe_record(const nlohmann::json& json, const fs::path& path) {
  const std::string schema = json.contains("schema") && json["schema"].is_string()
                                 ? json["schema"].get<std::string>()
                                 : "";
  if (schema == "raysplats-bench") return describe_benchmark(path);
  if (schema == "raysplats-tuning") return describe_tuning(json);
  if (json.contains("transform") && json.contains("scale") && is_matrix(json["transform"], 3, 4))
    return Json{{"type", "transform of nerfstudio"}, {"scale", json["scale"]}};
  Json out;
  if (json.contains("training_seconds")) {
    out["type"] = "metrics of a run";
    copy_plain(json,
               {"complete", "iteration", "iterations", "gaussians", "loss", "training_seconds",
                "device", "driver", "version", "command"},
               out);
    if (const std::string last = report::last_command(json); !last.empty())
      out["last_command"] = last;
    return out;
  }
  if (json.contains("images") && json["images"].is_array() && json.contains("psnr")) {
    out = {{"type", "metrics of an evaluation"}, {"views", json["images"].size()}};
    copy_plain(
        json,
        {"psnr", "psnr_corrected", "psnr_shifted", "psnr_aligned", "psnr_all", "ssim", "lpips"},
        out);
    return out;
  }
  const bool exposures =
      !json.empty() &&
      std::all_of(json.begin(), json.end(), [](const auto& each) { return is_matrix(each, 3, 4); });
  if (exposures) return Json{{"type", "exposures"}, {"photos", json.size()}};
  return std::nullopt;
}

}  // namespace raysplats::cli
