// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/polycam.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <vector>

#include "io/json_file.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::vector<fs::path> camera_files(const fs::path& folder) {
  std::vector<fs::path> files;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    const fs::path& path = entry->path();
    if (lower_extension(path) == ".json" && !is_apple_double(path)) files.push_back(path);
  }
  std::sort(files.begin(), files.end());
  return files;
}

/// The entry of a transforms file that says the same as a file of Polycam's.
json frame_of(const fs::path& path, const fs::path& photo) {
  const json camera = read_json_object(path);
  const auto number = [&](const std::string& key) {
    const auto found = camera.find(key);
    if (found == camera.end() || !found->is_number()) {
      throw DataError(fmt::format(
          "{} has no number '{}': it is no camera of Polycam's, export its raw data again",
          path.string(), key));
    }
    return *found;
  };
  json matrix = json::array();
  for (const int row : {2, 0, 1}) {  // z, x, y: y was up
    json line = json::array();
    for (int column = 0; column < 4; ++column)
      line.push_back(number(fmt::format("t_{}{}", row, column)));
    matrix.push_back(std::move(line));
  }
  return {{"file_path", photo.generic_string()},
          {"w", number("width")},
          {"h", number("height")},
          {"fl_x", number("fx")},
          {"fl_y", number("fy")},
          {"cx", number("cx")},
          {"cy", number("cy")},
          {"transform_matrix", std::move(matrix)}};
}

}  // namespace

std::optional<PolycamFolders> find_polycam(const fs::path& root) {
  for (const fs::path& base : {root / "keyframes", root}) {
    for (const std::string prefix : {"corrected_", ""}) {
      const PolycamFolders folders{base / (prefix + "cameras"), base / (prefix + "images"),
                                   base / "depth"};
      if (is_folder(folders.photos) && !camera_files(folders.cameras).empty()) return folders;
    }
  }
  return std::nullopt;
}

TransformsFile read_polycam(const PolycamFolders& folders, const fs::path& root) {
  json frames = json::array();
  for (const fs::path& file : camera_files(folders.cameras)) {
    const fs::path photo = folders.photos.lexically_relative(root) / file.stem();
    json frame = frame_of(file, photo);
    const fs::path depth = folders.depths / (file.stem().string() + ".png");
    if (is_file(depth)) frame["depth_file_path"] = depth.lexically_relative(root).generic_string();
    frames.push_back(std::move(frame));
  }
  // The folder stands for the file that would list its cameras.
  return parse_transforms({{"frames", std::move(frames)}}, root / "cameras");
}

}  // namespace raysplats::io
