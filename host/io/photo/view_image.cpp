// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstddef>

#include "io/photo/view_rows.hpp"
#include "raysplats/dataset.hpp"
#include "scene/image/image_check.hpp"

namespace raysplats {

Image load_view_image(const View& view) { return load_view_picture(view).rgba; }

ViewPicture load_view_picture(const View& view) {
  io::ViewRows rows(view);
  const int width = view.camera.width, height = view.camera.height;
  ViewPicture out{Image(width, height, 4), {}};
  if (view.mask_apart) out.weight = Image(width, height, 1);
  float* rgba = out.rgba.data.data();
  float* weight = out.weight.data.data();
  rows.read([&](const float* row, const float* weights) {
    rgba = std::copy_n(row, 4 * static_cast<std::size_t>(width), rgba);
    if (weights != nullptr) weight = std::copy_n(weights, static_cast<std::size_t>(width), weight);
  });
  return out;
}

Image composite(const Image& rgba, const float background[3]) {
  check_image(rgba, "The picture that is composited");
  Image out(rgba.width, rgba.height, 3);
  const auto channels = static_cast<std::size_t>(rgba.channels);
  const bool grey = channels < 3;
  const bool has_alpha = channels == 2 || channels >= 4;
  for (std::size_t i = 0; i < rgba.pixels(); ++i) {
    const float* source = &rgba.data[i * channels];
    const float alpha = has_alpha ? source[channels == 2 ? 1 : 3] : 1.0f;
    for (std::size_t c = 0; c < 3; ++c) {
      out.data[3 * i + c] = alpha * source[grey ? 0 : c] + (1.0f - alpha) * background[c];
    }
  }
  return out;
}

}  // namespace raysplats
