// SPDX-License-Identifier: Apache-2.0
#include "io/photo/view_rows.hpp"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <utility>
#include <variant>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/photo/photo_border.hpp"
#include "io/photo/photo_orientation.hpp"

namespace raysplats::io {
namespace {

// Programs that heed EXIF and others that do not: a mask may lie where its photo is upright, and
// stand where it lies.
RawImage mask_of_photo(const View& view, bool turned) {
  RawImage mask = read_raw_image(view.mask_path);
  const Camera& photo = view.source_camera;
  const bool other =
      !has_shape(mask.width, mask.height, photo) && has_shape(mask.height, mask.width, photo);
  if (!other || !lies_on_its_side(view.image_path)) return mask;
  return turned ? turned_upright(mask, view.image_path) : as_stored(mask, view.image_path);
}

// What the file says of the colours of a photo. Only floats are light and only alpha multiplies, so
// that most photos are not opened for it.
PhotoColors colors_of(const RawImage& raw, const std::filesystem::path& path) {
  const bool floats = std::holds_alternative<std::vector<float>>(raw.numbers);
  const bool covered = raw.channels == 2 || raw.channels == 4;
  if (!floats && !covered) return {};
  return image_codec().photo_colors(path.string());
}

}  // namespace

ViewRows::ViewRows(const View& view) {
  StoredPhoto photo = read_photo(view);
  raw_ = std::move(photo.raw);
  const PhotoColors colors = colors_of(raw_, view.image_path);
  unchanged_ = !colors.light && !colors.associated;
  const bool masked = !view.mask_path.empty();
  if (masked) {
    mask_ = mask_plane(mask_of_photo(view, photo.turned));
    unchanged_ = false;
  }
  const bool bordered = has_border(raw_, view);
  const auto pixels = [&](const MaskPlane* mask) {
    auto decoded = decoded_rows(raw_, mask, colors);
    if (bordered) decoded = bordered_rows(std::move(decoded), view.border);
    return view.ignored.empty() ? std::move(decoded)
                                : rows_without(std::move(decoded), view.ignored);
  };
  if (bordered || view.mask_apart || !view.ignored.empty()) unchanged_ = false;
  rows_ = fitted(pixels(masked ? &mask_ : nullptr), view);
  if (!view.mask_apart) return;
  // Beside a mask that says what is background, what the photo itself shows is all that counts.
  const bool ignores = masked && !view.mask_cuts;
  weights_ = fitted(ignores ? mask_rows(mask_, raw_.width, raw_.height) : pixels(nullptr), view);
}

// Takes the lens out of a picture and gives it the view's size.
std::unique_ptr<PhotoRows> ViewRows::fitted(std::unique_ptr<PhotoPixels> source, const View& view) {
  const PhotoRows* before = source.get();
  std::unique_ptr<PhotoRows> out;
  const CameraModel lens = view.source_camera.model;
  if (lens == CameraModel::kPhotoLens ||
      (lens == CameraModel::kOpenCv && view.camera.model == CameraModel::kPinhole)) {
    out = undistorted_rows(std::move(source), view.source_camera);
  } else {
    out = seen_rows(std::move(source), view.source_camera);
  }
  out = reduced_rows(std::move(out), view.camera.width, view.camera.height);
  unchanged_ = unchanged_ && out.get() == before;
  return out;
}

void ViewRows::read(const std::function<void(const float*, const float*)>& take) {
  const auto width = static_cast<std::size_t>(rows_->width());
  std::vector<float> rgba(4 * width), weight_rgba(weights_ ? 4 * width : 0);
  std::vector<float> weights(weights_ ? width : 0);
  for (int y = 0; y < rows_->height(); ++y) {
    rows_->row(y, rgba.data());
    if (!weights_) {
      take(rgba.data(), nullptr);
      continue;
    }
    weights_->row(y, weight_rgba.data());
    for (std::size_t x = 0; x < width; ++x) {
      // Where nothing is known the coverage is none, so that colours come from known pixels; where
      // something is, it is the coverage of that.
      const float share = weight_rgba[4 * x + 3];
      float& alpha = rgba[4 * x + 3];
      alpha = share > 0 ? std::min(alpha / share, 1.0f) : 0.0f;
      weights[x] = share;
    }
    take(rgba.data(), weights.data());
  }
}

}  // namespace raysplats::io
