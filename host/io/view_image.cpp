// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "io/resample.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"

namespace raysplats {
namespace {

/// Grey or colour, with or without alpha, as RGBA.
Image to_rgba(Image image) {
  if (image.channels == 4) return image;
  Image out(image.width, image.height, 4, 1.0f);
  const auto channels = static_cast<std::size_t>(image.channels);
  const bool grey = channels < 3;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float* source = &image.data[i * channels];
    float* target = &out.data[4 * i];
    for (std::size_t c = 0; c < 3; ++c) target[c] = source[grey ? 0 : c];
    if (channels == 2) target[3] = source[1];
  }
  return out;
}

/// Multiplies alpha by the mask's first channel; a mask of another size is taken pixel by nearest
/// pixel.
void apply_mask(Image& rgba, const Image& mask) {
  for (int y = 0; y < rgba.height; ++y) {
    const int mask_y = static_cast<int>(static_cast<long>(y) * mask.height / rgba.height);
    for (int x = 0; x < rgba.width; ++x) {
      const int mask_x = static_cast<int>(static_cast<long>(x) * mask.width / rgba.width);
      rgba.at(x, y, 3) *= std::clamp(mask.at(mask_x, mask_y, 0), 0.0f, 1.0f);
    }
  }
}

void require_light(const Image& mask, const View& view) {
  for (std::size_t i = 0; i < mask.pixels(); ++i) {
    if (mask.data[i * static_cast<std::size_t>(mask.channels)] > 0) return;
  }
  throw DataError(
      fmt::format("The mask {} is black everywhere and leaves nothing of its photo {}: remove the "
                  "photo from the data set, or the mask",
                  view.mask_path.string(), view.image_path.string()));
}

/// Takes the lens out of a picture and gives it the view's size.
Image fitted(Image rgba, const View& view) {
  if (view.source_camera.model == CameraModel::kOpenCv &&
      view.camera.model == CameraModel::kPinhole) {
    rgba = io::undistort(std::move(rgba), view.source_camera);
  } else {
    io::mask_unseen(rgba, view.source_camera);
  }
  if (rgba.width == view.camera.width && rgba.height == view.camera.height) return rgba;
  return io::area_resample(rgba, view.camera.width, view.camera.height);
}

}  // namespace

Image load_view_image(const View& view) { return load_view_picture(view).rgba; }

ViewPicture load_view_picture(const View& view) {
  Image rgba = to_rgba(read_image(view.image_path));
  if (rgba.width != view.source_camera.width || rgba.height != view.source_camera.height) {
    throw DataError(
        fmt::format("The image {} has {} x {} pixels now, but {} x {} when the data set was opened",
                    view.image_path.string(), rgba.width, rgba.height, view.source_camera.width,
                    view.source_camera.height));
  }
  if (view.mask_path.empty()) return {fitted(std::move(rgba), view), {}};
  const Image mask = read_image(view.mask_path);
  require_light(mask, view);
  apply_mask(rgba, mask);
  if (!view.mask_apart) return {fitted(std::move(rgba), view), {}};
  Image weight(rgba.width, rgba.height, 4, 1.0f);
  apply_mask(weight, mask);
  // Where nothing is known the coverage is none, so that resampling takes it from known pixels.
  return io::take_weight(fitted(std::move(rgba), view), fitted(std::move(weight), view));
}

Image composite(const Image& rgba, const float background[3]) {
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
