// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/dataset_advice.hpp"

#include <fmt/format.h>

#include <set>
#include <system_error>

#include "io/dataset/llff.hpp"
#include "io/dataset/polycam.hpp"
#include "io/image/image_file.hpp"
#include "util/file_kind.hpp"
#include "util/shell_word.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// What makes something that is read of another program's folder; "" for any that is not known.
std::string advice_for_other_programs(const fs::path& root) {
  const fs::path sequence = root / "EXR_RGBD";
  if ((is_file(root / "metadata.json") && is_folder(root / "rgbd")) ||
      (is_file(sequence / "metadata.json") && is_folder(sequence / "rgb"))) {
    return "; it is an export of Record3D, which nerfstudio's \"ns-process-data record3d\" turns "
           "into one";
  }
  return "";
}

}  // namespace

bool looks_like_dataset(const fs::path& folder) {
  return is_folder(folder / "sparse") || is_file(folder / "transforms.json") ||
         is_file(folder / "transforms_train.json") || is_file(folder / kLlffPoses) ||
         find_polycam(folder) || is_folder(folder / "colmap" / "sparse") ||
         is_file(folder / "colmap" / "images.bin") || is_file(folder / "colmap" / "images.txt");
}

std::optional<fs::path> enclosing_data_set(const fs::path& root) {
  constexpr int kLevels = 3;  // colmap/sparse/0
  std::error_code error;
  // A slash at the end would count as a level.
  fs::path folder = (fs::absolute(root, error) / "").lexically_normal().parent_path();
  for (int level = 0; level < kLevels && folder.has_relative_path(); ++level) {
    folder = folder.parent_path();
    // What these hold is a part of the data set that they lie in.
    const bool is_part = folder.filename() == "colmap" || folder.filename() == "distorted";
    if (!is_part && looks_like_dataset(folder)) return folder;
  }
  return std::nullopt;
}

std::string advice_for(const fs::path& root) {
  std::set<fs::path> inner;
  std::error_code failure;
  for (fs::directory_iterator entry(root, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    if (looks_like_dataset(entry->path())) inner.insert(entry->path());
  }
  if (std::string other = advice_for_other_programs(root); !other.empty()) return other;
  if (!inner.empty()) return fmt::format("; {} is one", inner.begin()->string());
  if (const std::optional<fs::path> whole = enclosing_data_set(root))
    return fmt::format("; it is a part of one: give {}", whole->string());
  for (const fs::path& folder : {root / "input", root / "images", root}) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      if (!is_photo_name(entry->path())) continue;
      return fmt::format(
          "; find out where its photos were taken: raysplats prepare {} -o NEW_FOLDER",
          shell_word(folder.string()));
    }
  }
  return "";
}

}  // namespace raysplats::io
