// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "io/image/image_file.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::test {

/// A view that shows a photo as it is stored.
inline View view_of(const std::filesystem::path& path) {
  const io::ImageSize size = io::image_size(path);
  View view;
  view.image_path = path;
  view.camera.width = view.source_camera.width = size.width;
  view.camera.height = view.source_camera.height = size.height;
  view.sample_bytes = size.sample_bytes;
  return view;
}

}  // namespace raysplats::test
