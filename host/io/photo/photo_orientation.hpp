// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "io/image/image_codec.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Cameras belong to the pixels as they are stored, as COLMAP and most tools see them; others turn
/// photos of telephones upright first, as their EXIF orientation says. Which of both a camera's
/// maker did shows in its shape alone, so that a photo is turned only where that fits.

/// Whether the file says that its photo lies on its side: EXIF orientation 6 or 8. Throws DataError
/// as image_size().
bool lies_on_its_side(const std::filesystem::path& path);

/// Whether a picture of that size has the camera's shape, to rounding; it may be larger or smaller.
bool has_shape(int width, int height, const Camera& camera);

/// The picture of such a file, or one that was made of it, turned upright.
RawImage turned_upright(const RawImage& raw, const std::filesystem::path& path);

/// The other way round: a picture that was made of it upright, turned as it is stored.
RawImage as_stored(const RawImage& raw, const std::filesystem::path& path);

/// The photo of a view, as its camera has it.
struct StoredPhoto {
  RawImage raw;
  bool turned = false;  ///< turned_upright()
};

/// Throws DataError for what read_raw_image() cannot read, and for another size than the camera's.
StoredPhoto read_photo(const View& view);

}  // namespace raysplats::io
