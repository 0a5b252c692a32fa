// SPDX-License-Identifier: Apache-2.0
#include "run/run_folder.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "io/dataset/data_origin.hpp"
#include "io/dataset/transforms.hpp"
#include "io/dataset/transforms_camera.hpp"
#include "io/file_hash.hpp"
#include "io/model/model_formats.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/train_config.hpp"
#include "util/atomic_file.hpp"
#include "util/json_text.hpp"
#include "util/number_text.hpp"
#include "util/output_directory.hpp"

namespace raysplats {
namespace {

constexpr char kMoving[] = "moving";
constexpr std::array<const char*, 7> kReports{
    "config.toml",    "cameras.json",         "metrics.csv", "metrics.json",
    "exposures.json", "cameras_refined.json", "report.html"};

std::string iteration_name(std::int64_t iteration) {
  return fmt::format("iteration_{}", iteration);
}

std::filesystem::path model_file(const std::filesystem::path& run, std::int64_t iteration) {
  return run / "point_cloud" / iteration_name(iteration) / "point_cloud.ply";
}

// N of a file or folder called PREFIX N SUFFIX.
std::optional<std::int64_t> number_in(std::string_view name,
                                      std::string_view prefix,
                                      std::string_view suffix) {
  if (name.size() <= prefix.size() + suffix.size() || !name.starts_with(prefix) ||
      !name.ends_with(suffix)) {
    return std::nullopt;
  }
  name.remove_prefix(prefix.size());
  name.remove_suffix(suffix.size());
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(name.data(), name.data() + name.size(), value);
  return error == std::errc() && end == name.data() + name.size() ? std::optional(value)
                                                                  : std::nullopt;
}

// The entries of a folder that are called so, with their numbers.
std::vector<std::pair<std::int64_t, std::filesystem::path>> numbered(
    const std::filesystem::path& folder, std::string_view prefix, std::string_view suffix) {
  std::vector<std::pair<std::int64_t, std::filesystem::path>> out;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const auto number = number_in(entry.path().filename().string(), prefix, suffix);
    if (number) out.emplace_back(*number, entry.path());
  }
  std::sort(out.begin(), out.end());
  return out;
}

void remove_file(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::remove(path, error);
  if (error) {
    throw DataError(fmt::format("{} cannot be removed: {}", path.string(), error.message()));
  }
}

// A folder goes when nothing else is in it.
void remove_if_empty(const std::filesystem::path& folder) {
  std::error_code error;
  if (std::filesystem::is_empty(folder, error) && !error) remove_file(folder);
}

void remove_pictures(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> pictures;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".png") pictures.push_back(entry.path());
  }
  for (const std::filesystem::path& picture : pictures) remove_file(picture);
}

}  // namespace

RunFolder::RunFolder(std::filesystem::path path, bool writes)
    : path_(std::move(path)), writes_(writes) {
  if (writes_) check_output_directory(path_);
}

FileLock RunFolder::lock() const {
  make_output_directory(path_);
  FileLock lock(path_ / ".lock");
  const std::size_t stale = remove_stale_temporaries(path_);
  if (stale > 0) {
    spdlog::info("Removed {} that a killed process has left",
                 counted(static_cast<double>(stale), "temporary file"));
  }
  return lock;
}

std::filesystem::path RunFolder::evaluation_folder(std::int64_t iteration) const {
  return path_ / "eval" / iteration_name(iteration);
}

void RunFolder::write_config(const TrainOptions& options) const {
  if (!writes_) return;
  write_text_file(path_ / "config.toml", to_toml(options));
}

void RunFolder::write_cameras(std::span<const Camera> cameras) const {
  if (!writes_) return;
  nlohmann::json list = nlohmann::json::array();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Camera& camera = cameras[i];
    const glm::dvec3 center = camera.center();
    nlohmann::json rotation = nlohmann::json::array();
    // Row r, column c of camera-to-world; glm's m[column][row] of the inverse, which is the
    // transpose.
    for (int r = 0; r < 3; ++r) {
      rotation.push_back({camera.rotation[r][0], camera.rotation[r][1], camera.rotation[r][2]});
    }
    nlohmann::json entry{{"id", i},
                         {"img_name", camera.name},
                         {"width", camera.width},
                         {"height", camera.height},
                         {"position", {center.x, center.y, center.z}},
                         {"rotation", rotation}};
    if (camera.model != CameraModel::kEquirectangular) {
      entry["fy"] = camera.fy;
      entry["fx"] = camera.fx;
    }
    entry.update(io::lens_keys(camera));
    list.push_back(std::move(entry));
  }
  write_text_file(path_ / "cameras.json", json_text(list) + "\n");
}

void RunFolder::write_exposures(std::span<const Camera> cameras,
                                std::span<const float> deltas) const {
  if (!writes_) return;
  nlohmann::json json = nlohmann::json::object();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    nlohmann::json rows = nlohmann::json::array();
    for (std::size_t c = 0; c < 3; ++c) {
      const float* row = deltas.data() + 12 * i + 4 * c;
      nlohmann::json values = {row[0], row[1], row[2], row[3]};
      values[c] = 1.0f + row[c];
      rows.push_back(std::move(values));
    }
    json[cameras[i].name] = std::move(rows);
  }
  write_text_file(path_ / "exposures.json", json_text(json, 1) + "\n");
}

void RunFolder::write_refined_cameras(std::vector<Camera> cameras,
                                      const std::array<double, 3>& origin) const {
  if (!writes_) return;
  for (Camera& camera : cameras)
    io::move_origin(camera, -glm::dvec3(origin[0], origin[1], origin[2]));
  raysplats::write_cameras(path_ / "cameras_refined.json", cameras);
}

void RunFolder::write_model(const Gaussians& model,
                            const TraceOptions& trace,
                            std::int64_t iteration,
                            const std::array<double, 3>& origin) const {
  if (!writes_) return;
  io::write_ply_as_it_is(model_file(path_, iteration), model, trace, origin);
}

bool RunFolder::has_model(std::int64_t iteration) const {
  std::error_code error;
  return std::filesystem::exists(model_file(path_, iteration), error);
}

std::optional<std::int64_t> RunFolder::newest_model() const {
  std::optional<std::int64_t> newest;
  for (const auto& [number, folder] : numbered(path_ / "point_cloud", "iteration_", "")) {
    if (has_model(number)) newest = number;
  }
  return newest;
}

void RunFolder::remove_model(std::int64_t iteration) const {
  if (!writes_) return;
  if (!has_model(iteration)) return;
  const std::filesystem::path file = model_file(path_, iteration);
  remove_file(file);
  remove_if_empty(file.parent_path());
}

void RunFolder::remove_evaluation(std::int64_t iteration) const {
  if (!writes_) return;
  const std::filesystem::path folder = evaluation_folder(iteration);
  remove_pictures(folder);
  remove_file(folder / "metrics.json");
  remove_if_empty(folder);
}

void RunFolder::write_moving(const std::string& photo, const Image& mask) const {
  if (!writes_) return;
  const std::filesystem::path file = path_ / kMoving / (io::inner_name(photo) + ".png");
  make_output_directory(file.parent_path());
  write_image(file, mask);
}

void RunFolder::remove_moving() const {
  const std::filesystem::path folder = path_ / kMoving;
  std::error_code error;
  if (!writes_ || !std::filesystem::is_directory(folder, error)) return;
  std::vector<std::filesystem::path> folders{folder};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  // The innermost first.
  std::sort(folders.rbegin(), folders.rend());
  for (const std::filesystem::path& each : folders) {
    remove_pictures(each);
    remove_if_empty(each);
  }
}

std::string RunFolder::model_hash(std::int64_t iteration) const {
  return io::file_hash(model_file(path_, iteration)).value_or("");
}

void RunFolder::remove_after(std::int64_t iteration) const {
  if (!writes_) return;
  for (const auto& [number, file] : numbered(path_ / "checkpoints", "step_", ".rsck")) {
    if (number > iteration) remove_file(file);
  }
  for (const auto& [number, folder] : numbered(path_ / "point_cloud", "iteration_", "")) {
    if (number > iteration) remove_model(number);
  }
  for (const auto& [number, folder] : numbered(path_ / "eval", "iteration_", "")) {
    if (number > iteration) remove_evaluation(number);
  }
  if (iteration > 0) return;
  for (const char* report : kReports) remove_file(path_ / report);
  remove_moving();
}

void check_no_run(const std::filesystem::path& folder) {
  std::int64_t newest = -1;
  for (const auto& [number, path] : numbered(folder / "checkpoints", "step_", ".rsck")) {
    newest = std::max(newest, number);
  }
  for (const auto& [number, path] : numbered(folder / "point_cloud", "iteration_", "")) {
    newest = std::max(newest, number);
  }
  const auto exists = [&](const char* name) {
    std::error_code error;
    return std::filesystem::exists(folder / name, error);
  };
  if (newest < 0 && std::none_of(kReports.begin(), kReports.end(), exists)) return;
  throw UsageError(fmt::format(
      "The folder {} holds another run ({}): go on with it by --resume latest, choose another "
      "folder, or replace it by --overwrite",
      folder.string(), newest < 0 ? "without a checkpoint" : fmt::format("iteration {}", newest)));
}

}  // namespace raysplats
