// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/llff.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/npy_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kRow = 17;
constexpr std::size_t kMatrixColumns = 5;

std::vector<std::string> photo_names(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (is_photo_name(entry->path())) names.push_back(entry->path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

nlohmann::json frame_of(const float* row, const std::string& file_path) {
  const auto at = [&](std::size_t i, std::size_t j) {
    return static_cast<double>(row[kMatrixColumns * i + j]);
  };
  nlohmann::json matrix = nlohmann::json::array();
  // Right, up and back, as transforms files have them.
  for (std::size_t i = 0; i < 3; ++i) matrix.push_back({at(i, 1), -at(i, 0), at(i, 2), at(i, 3)});
  return {{"file_path", file_path},
          {"h", at(0, 4)},
          {"w", at(1, 4)},
          {"fl_x", at(2, 4)},
          {"transform_matrix", std::move(matrix)}};
}

}  // namespace

TransformsFile read_llff(const fs::path& path, const fs::path& photos) {
  const NpyArray array = read_npy(path);
  if (array.shape.size() != 2 || array.shape[1] != kRow) {
    throw DataError(fmt::format(
        "{} has the shape ({}), not LLFF's of {} numbers for every photo: make it again "
        "with LLFF's imgs2poses.py",
        path.string(), fmt::join(array.shape, ", "), kRow));
  }
  const std::vector<std::string> names = photo_names(photos);
  if (names.size() != array.shape[0]) {
    throw DataError(
        fmt::format("{} has {} rows but {} has {} photos: rows belong to photos in the order of "
                    "their names, so that there must be as many",
                    path.string(), array.shape[0], photos.string(), names.size()));
  }
  const fs::path folder = photos.lexically_relative(path.parent_path());
  nlohmann::json frames = nlohmann::json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    frames.push_back(frame_of(array.data.data() + kRow * i, (folder / names[i]).generic_string()));
  }
  return parse_transforms({{"frames", std::move(frames)}}, path);
}

}  // namespace raysplats::io
