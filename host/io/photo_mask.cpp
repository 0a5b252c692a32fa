// SPDX-License-Identifier: Apache-2.0
#include "io/photo_mask.hpp"

#include <fmt/format.h>

#include <optional>
#include <string>

#include "io/find_image.hpp"
#include "io/image_file.hpp"
#include "io/photo_turn.hpp"
#include "io/transforms.hpp"
#include "raysplats/error.hpp"
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

}  // namespace

fs::path mask_folder(const fs::path& root) {
  return is_folder(root / "masks") ? root / "masks" : root / "resized_anon_masks";
}

MaskFinder::MaskFinder(const fs::path& root) {
  if (const fs::path folder = mask_folder(root); is_folder(folder)) folder_ = folder;
}

void MaskFinder::add(const fs::path& name) {
  const std::string path = inner_name(name);
  if (!photos_.insert(path).second) return;
  if (photos_.size() == 1) shared_ = fs::path(path).parent_path().generic_string();
  while (!lies_in(path, shared_)) shared_ = fs::path(shared_).parent_path().generic_string();
  const std::string stem = stem_of(path);
  for (std::size_t at = 0; at != std::string::npos; at = next_part(stem, at))
    ++ends_[stem.substr(at)];
}

fs::path MaskFinder::find(const fs::path& name) const {
  if (folder_.empty()) return {};
  // Absolute names and those with ".." would lead to the photo itself.
  const std::string path = inner_name(name);
  for (std::size_t at = 0; at != std::string::npos; at = next_part(path, at)) {
    const std::string end = path.substr(at);
    const bool counts = at == 0 || (lies_in(path, shared_) && at == shared_.size() + 1) ||
                        !is_shared(ends_, stem_of(end));
    if (!counts) continue;
    if (const auto mask = mask_named(folder_, end)) return *mask;
  }
  return {};
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
