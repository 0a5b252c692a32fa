// SPDX-License-Identifier: Apache-2.0
#include "run/run_cameras.hpp"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <optional>
#include <system_error>

#include "io/dataset/camera_list.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

std::optional<fs::path> run_of(const ModelSource& source) {
  std::error_code error;
  const fs::path models =
      fs::absolute(source.file, error).lexically_normal().parent_path().parent_path();
  if (!source.iteration || models.filename() != "point_cloud") return std::nullopt;
  return models.parent_path();
}

}  // namespace

std::vector<Camera> run_cameras(const ModelSource& source) {
  const std::optional<fs::path> run = run_of(source);
  if (!run) return {};
  const fs::path path = *run / "cameras.json";
  std::error_code error;
  if (!fs::is_regular_file(path, error)) return {};
  return io::read_listed_views(path);
}

std::vector<Camera> readable_run_cameras(const ModelSource& source, const char* asker) {
  try {
    return run_cameras(source);
  } catch (const DataError& error) {
    spdlog::warn("{} has no cameras of the run: {}", asker, error.what());
    return {};
  }
}

}  // namespace raysplats
