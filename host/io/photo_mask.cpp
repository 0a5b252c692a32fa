// SPDX-License-Identifier: Apache-2.0
#include "io/photo_mask.hpp"

#include <fmt/format.h>

#include <string>

#include "io/find_image.hpp"
#include "io/image_file.hpp"
#include "io/photo_turn.hpp"
#include "io/transforms.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {

namespace fs = std::filesystem;

fs::path mask_folder(const fs::path& root) {
  return is_folder(root / "masks") ? root / "masks" : root / "resized_anon_masks";
}

fs::path find_mask(const fs::path& root, const fs::path& name) {
  const fs::path folder = mask_folder(root);
  if (!is_folder(folder)) return {};
  // Absolute names and those with ".." would lead to the photo itself.
  const std::string whole = inner_name(name);
  const std::string stem = fs::path(whole).replace_extension().string();
  for (const std::string& candidate : {whole + ".png", stem, stem + "_mask", stem + ".mask"}) {
    if (const auto found = find_image(folder, candidate)) return *found;
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
