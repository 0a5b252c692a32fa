// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "io/dataset/colmap_model.hpp"
#include "io/dataset/find_image.hpp"

namespace raysplats::io {

/// A folder of photos and the factor by which they are smaller than the model's cameras.
struct PhotoFolder {
  std::filesystem::path path;
  double factor = 1.0;
};

/// Where photos below `root` lie: reduced copies of 3DGS and LLFF (images_4) where they fit
/// `downscale` or are all there is, `images`, or `root` itself.
PhotoFolder usual_photo_folder(const std::filesystem::path& root, double downscale);

/// usual_photo_folder() where it is one of reduced copies.
std::optional<PhotoFolder> reduced_copies(const std::filesystem::path& root, double downscale);

/// Where the photos of a COLMAP model below the data set `root` lie: as usual_photo_folder(),
/// `root` being where they lie beside the model. The photos that convert.py
/// of 3DGS reads lie in `input`, and those that it makes of them, which are of another size and
/// without a lens, in `images`: the model tells which are its own, by the sizes of at least half of
/// its photos. Where neither is there, a folder
/// that other programs name (Images, rgb, resized_images of ScanNet++) and that has the model's
/// first photo. Where the usual folder has none of the photos (reduced copies of other names), but
/// `images` or the root has: that. Reduced copies that lack photos of `images` are not taken, and
/// those of another size than their folder says are warned of.
PhotoFolder photo_folder(const std::filesystem::path& root,
                         const ColmapModel& model,
                         double downscale);

/// A photo, and in what its name is another than that which was sought.
struct FoundPhoto {
  std::filesystem::path path;
  bool respelt = false;      ///< as RespeltFinder finds it
  bool reformatted = false;  ///< with another extension
};

/// The photo of a COLMAP image, by its whole name or by its last part: spelt so, or otherwise, or
/// the single one with another extension (reduced copies are often stored in another format).
std::optional<FoundPhoto> find_photo(const std::filesystem::path& folder,
                                     const std::filesystem::path& name,
                                     RespeltFinder& respelt);

}  // namespace raysplats::io
