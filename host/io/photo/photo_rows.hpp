// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "io/image/image_codec.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// A picture that is made row by row: RGBA in [0, 1] with straight alpha. What changes a photo on
/// its way from the file is made of one another, so that nothing in between is rounded or kept.
class PhotoRows {
 public:
  PhotoRows(int width, int height) : width_(width), height_(height) {}
  virtual ~PhotoRows() = default;
  PhotoRows(const PhotoRows&) = delete;
  PhotoRows& operator=(const PhotoRows&) = delete;

  int width() const { return width_; }
  int height() const { return height_; }
  /// Writes row y, 4 x width().
  virtual void row(int y, float* rgba) = 0;

 private:
  int width_;
  int height_;
};

/// One that can be asked for any pixel.
class PhotoPixels : public PhotoRows {
 public:
  using PhotoRows::PhotoRows;
  virtual void pixel(int x, int y, float* rgba) = 0;
};

/// One number per pixel of a photo, of any size: pixels are taken by the nearest.
struct MaskPlane {
  int width = 0;
  int height = 0;
  std::vector<float> values;

  float at(int x, int y, int photo_width, int photo_height) const;
};

/// What is not black in a mask, in [0, 1]: the greatest of its colours, times its alpha; alpha
/// alone where all colours are black and alpha is not the same everywhere. Numbers that are whole
/// and at most 31 of 255 or of 65535 are labels of objects, each of which above 0 is white.
MaskPlane mask_plane(const RawImage& mask);

/// Whether mask_plane() is 0 everywhere.
bool is_black(const RawImage& mask);

/// The photo of a file, grey or colour, with or without alpha, which `mask` (may be null)
/// multiplies. Refers to both.
std::unique_ptr<PhotoPixels> decoded_rows(const RawImage& image,
                                          const MaskPlane* mask,
                                          PhotoColors colors = {});
/// Alpha 0 in the border.
std::unique_ptr<PhotoPixels> bordered_rows(std::unique_ptr<PhotoPixels> source,
                                           std::shared_ptr<const PhotoBorder> border);
/// Alpha 0 in the areas.
std::unique_ptr<PhotoPixels> rows_without(std::unique_ptr<PhotoPixels> source,
                                          std::span<const PhotoArea> areas);
/// White whose alpha is the mask, at the size of a photo.
std::unique_ptr<PhotoPixels> mask_rows(const MaskPlane& mask, int width, int height);

/// The picture that a camera without a lens of its own would have taken in the place of this one:
/// for kOpenCv a pinhole with its intrinsics and size, for kPhotoLens rendered_camera() (bilinear,
/// colours weighted by alpha). Pixels whose ray leaves the photo, or lies beyond the limit of the
/// lens, get alpha 0.
std::unique_ptr<PhotoRows> undistorted_rows(std::unique_ptr<PhotoPixels> source,
                                            const Camera& camera);
/// Alpha 0 where the camera's lens (kOpenCv or kFisheye) sees nothing: beyond the image of
/// lens_limit().
std::unique_ptr<PhotoRows> seen_rows(std::unique_ptr<PhotoRows> source, const Camera& camera);
/// Average over the area of each target pixel, colours weighted by alpha; pixels without any
/// coverage are 0. O(pixels of both pictures).
std::unique_ptr<PhotoRows> reduced_rows(std::unique_ptr<PhotoRows> source, int width, int height);

}  // namespace raysplats::io
