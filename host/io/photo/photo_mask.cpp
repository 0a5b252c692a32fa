// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_mask.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <string>

#include "io/dataset/find_image.hpp"
#include "io/dataset/transforms.hpp"
#include "io/image/image_file.hpp"
#include "io/photo/photo_orientation.hpp"
#include "raysplats/error.hpp"
#include "util/ascii.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {

namespace fs = std::filesystem;

namespace {

bool lies_in(const std::string& path, const std::string& folder) {
  return folder.empty() || path.starts_with(folder + "/");
}

/// Where the part of a path begins that follows the one at `at`.
std::size_t next_part(const std::string& path, std::size_t at) {
  const std::size_t slash = path.find('/', at);
  return slash == std::string::npos ? slash : slash + 1;
}

std::string stem_of(const std::string& path) {
  return fs::path(path).replace_extension().generic_string();
}

bool is_shared(const std::map<std::string, std::size_t>& ends, const std::string& end) {
  const auto found = ends.find(end);
  return found != ends.end() && found->second > 1;
}

/// The mask in a folder that is called as the photo `name`.
std::optional<fs::path> mask_named(const fs::path& folder, const std::string& name) {
  const std::string stem = stem_of(name);
  for (const std::string& candidate : {name + ".png", stem, stem + "_mask", stem + ".mask"}) {
    if (auto found = find_image(folder, candidate)) return found;
  }
  return std::nullopt;
}

/// Where masks lie that nothing names; empty where there is no such folder.
fs::path mask_folder(const fs::path& root) {
  RespeltFinder folders;
  for (const char* name : {"masks", "mask", "resized_anon_masks"}) {
    if (const auto folder = folders.find_folder(root, name)) return *folder;
  }
  return {};
}

void warn_of_dynamic_masks(const std::vector<View>& views, const fs::path& root) {
  std::size_t count = 0;
  fs::path first;
  for (const View& view : views) {
    const fs::path mask = view.image_path.parent_path() /
                          ("dynamic_mask_" + view.image_path.stem().string() + ".png");
    if (is_file(mask) && count++ == 0) first = mask;
  }
  if (count == 0) return;
  spdlog::warn(
      "{} of {} photos have a mask of instant-ngp beside them ({}), where white does not count: "
      "these are not read, so put them inverted, and under the names of their photos, into {}",
      count, views.size(), first.string(), (root / "masks").string());
}

}  // namespace

MaskFinder::MaskFinder(const fs::path& root) : root_(root), folder_(mask_folder(root)) {}

void MaskFinder::add(const fs::path& name) {
  const std::string path = inner_name(name);
  const bool is_first = photos_.empty();
  if (!photos_.insert(path).second) return;
  const auto learn = [&](Known& known, const std::string& spelling) {
    if (is_first) known.shared = fs::path(spelling).parent_path().generic_string();
    while (!lies_in(spelling, known.shared))
      known.shared = fs::path(known.shared).parent_path().generic_string();
    const std::string stem = stem_of(spelling);
    for (std::size_t at = 0; at != std::string::npos; at = next_part(stem, at))
      ++known.ends[stem.substr(at)];
  };
  learn(exact_, path);
  learn(small_, ascii_lower(path));
}

fs::path MaskFinder::find(const fs::path& name, const fs::path& photo) const {
  // Absolute names and those with ".." would lead to the photo itself.
  const std::string path = inner_name(name);
  const std::string stored = inner_name(photo.lexically_normal().lexically_relative(
      root_.empty() ? fs::path(".") : root_.lexically_normal()));
  if (!folder_.empty()) {
    if (fs::path mask = find_in_folder(path, path, exact_); !mask.empty()) return mask;
    if (fs::path mask = find_in_folder(stored, ascii_lower(stored), small_); !mask.empty())
      return mask;
  }
  fs::path beside = photo;
  beside.replace_filename(photo.stem().string() + "_mask.png");
  // Another photo may be called so.
  const bool is_photo = photos_.contains(stem_of(path) + "_mask.png");
  return !is_photo && is_file(beside) ? beside : fs::path();
}

/// `spelling`: the path as `known` spells paths, of the same length.
fs::path MaskFinder::find_in_folder(const std::string& path,
                                    const std::string& spelling,
                                    const Known& known) const {
  for (std::size_t at = 0; at != std::string::npos && at < path.size(); at = next_part(path, at)) {
    const bool counts = at == 0 ||
                        (lies_in(spelling, known.shared) && at == known.shared.size() + 1) ||
                        !is_shared(known.ends, stem_of(spelling.substr(at)));
    if (!counts) continue;
    if (const auto mask = mask_named(folder_, path.substr(at))) return *mask;
  }
  return {};
}

void warn_of_masks(const std::vector<View>& views, const fs::path& root) {
  const auto has_no_mask = [](const View& view) { return view.mask_path.empty(); };
  const auto without =
      static_cast<std::size_t>(std::count_if(views.begin(), views.end(), has_no_mask));
  if (const fs::path folder = mask_folder(root); without == views.size() && !folder.empty()) {
    const std::string& name = views.front().camera.name;
    const std::string stem = stem_of(name);
    spdlog::warn(
        "No mask in {} has the name of a photo: {} would have {}.png, {}.png or {}_mask.png",
        folder.string(), name, name, stem, stem);
  } else if (without > 0 && without < views.size()) {
    spdlog::warn("{} of {} photos have no mask, {} among them: all of their pixels count", without,
                 views.size(),
                 std::find_if(views.begin(), views.end(), has_no_mask)->image_path.string());
  }
  warn_of_dynamic_masks(views, root);
}

void check_mask(const View& view) {
  const ImageSize size = image_size(view.mask_path);
  const Camera& photo = view.source_camera;
  const bool fits =
      has_shape(size.width, size.height, photo) ||
      (has_shape(size.height, size.width, photo) && lies_on_its_side(view.image_path));
  if (!fits) {
    throw DataError(fmt::format(
        "The mask {} has {} x {} pixels but its photo {} x {}, which is another shape: make it of "
        "the photo that it belongs to",
        view.mask_path.string(), size.width, size.height, photo.width, photo.height));
  }
}

}  // namespace raysplats::io
