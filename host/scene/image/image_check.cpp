// SPDX-License-Identifier: Apache-2.0
#include "scene/image/image_check.hpp"

#include <fmt/format.h>

#include <cstddef>

#include "raysplats/error.hpp"

namespace raysplats {

void check_image(const Image& image, const std::string& what) {
  const bool sized = image.width > 0 && image.height > 0 && image.channels > 0;
  if (sized && image.data.size() == image.pixels() * static_cast<std::size_t>(image.channels))
    return;
  throw UsageError(
      fmt::format("{} of {} x {} pixels and {} channels has {} numbers: give one for every channel "
                  "of every pixel",
                  what, image.width, image.height, image.channels, image.data.size()));
}

}  // namespace raysplats
