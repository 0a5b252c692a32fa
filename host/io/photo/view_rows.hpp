// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "io/photo/photo_rows.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// The decoded photo of a view on its way to the view's camera: masked, without its lens, reduced.
class ViewRows {
 public:
  /// Decodes photo and mask. Throws as load_view_picture() does.
  explicit ViewRows(const View& view);

  const RawImage& raw() const { return raw_; }
  /// Whether the picture is the photo, pixel by pixel.
  bool unchanged() const { return unchanged_; }
  /// Calls `take` for every row from the top: RGBA of camera.width pixels, and how much each of
  /// them counts, or null where all count alike.
  void read(const std::function<void(const float* rgba, const float* weights)>& take);

 private:
  std::unique_ptr<PhotoRows> fitted(std::unique_ptr<PhotoPixels> source, const View& view);

  RawImage raw_;
  MaskPlane mask_;
  std::unique_ptr<PhotoRows> rows_;
  std::unique_ptr<PhotoRows> weights_;  // of View::mask_apart: what counts is its alpha
  bool unchanged_ = true;
};

}  // namespace raysplats::io
