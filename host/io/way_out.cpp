// SPDX-License-Identifier: Apache-2.0
#include "io/way_out.hpp"

#include <fmt/format.h>

#include <set>

#include "io/image_file.hpp"
#include "io/llff.hpp"
#include "io/polycam.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

namespace fs = std::filesystem;

/// What makes something that is read of another program's folder; "" for any that is not known.
std::string way_out_of_others(const fs::path& root) {
  const fs::path sequence = root / "EXR_RGBD";
  if ((is_file(root / "metadata.json") && is_folder(root / "rgbd")) ||
      (is_file(sequence / "metadata.json") && is_folder(sequence / "rgb"))) {
    return "; it is an export of Record3D, which nerfstudio's \"ns-process-data record3d\" turns "
           "into one";
  }
  return "";
}

}  // namespace

std::string way_out(const fs::path& root) {
  std::set<fs::path> inner;
  std::error_code failure;
  for (fs::directory_iterator entry(root, failure), end; !failure && entry != end;
       entry.increment(failure)) {
    const fs::path& folder = entry->path();
    const bool is_data = is_folder(folder / "sparse") || is_file(folder / "transforms.json") ||
                         is_file(folder / "transforms_train.json") ||
                         is_file(folder / kLlffPoses) || find_polycam(folder) ||
                         is_file(folder / "colmap" / "images.txt");
    if (is_data) inner.insert(folder);
  }
  if (std::string other = way_out_of_others(root); !other.empty()) return other;
  if (!inner.empty()) return fmt::format("; {} is one", inner.begin()->string());
  for (const fs::path& folder : {root / "input", root / "images", root}) {
    std::error_code error;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      if (!has_image_extension(entry->path())) continue;
      return fmt::format(
          "; find out where its photos were taken: raysplats prepare {} -o NEW_FOLDER",
          folder.string());
    }
  }
  return "";
}

}  // namespace raysplats::io
