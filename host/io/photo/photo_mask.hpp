// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Finds masks that nothing names by the names of their photos: in the folder masks or mask, in any
/// letter case, or resized_anon_masks (ScanNet++), and beside the photos.
class MaskFinder {
 public:
  explicit MaskFinder(const std::filesystem::path& root);

  /// A photo of the data set, with its folders; what looks alike in several tells of none.
  void add(const std::filesystem::path& name);

  /// The mask of a photo that a file of cameras calls `name`, empty where there is none: COLMAP's
  /// name.ext.png, or an image that is called as the photo, with "_mask" or ".mask" behind it or
  /// without. The name counts as a whole, then without the folder that all photos share, then as
  /// far as no other photo's path ends so, the longest first. Of a name that is absolute or leads
  /// upwards inner_name() counts. Then the same of the path of the file `photo`, which may be spelt
  /// otherwise; last STEM_mask.png beside it (3dgrut).
  std::filesystem::path find(const std::filesystem::path& name,
                             const std::filesystem::path& photo) const;

 private:
  /// What add() has been told, with which a path is compared.
  struct Known {
    std::map<std::string, std::size_t> ends;  // how many paths end so, without extensions
    std::string shared;                       // the folder that all lie in; may be empty
  };
  std::filesystem::path find_in_folder(const std::string& path,
                                       const std::string& spelling,
                                       const Known& known) const;

  std::filesystem::path root_;
  std::filesystem::path folder_;  // empty where there is none
  std::set<std::string> photos_;  // inner_name() of each
  Known exact_;
  Known small_;  // in small letters
};

/// Warns where there is a folder of masks of which none is of a photo, where photos are without a
/// mask although others have one, and where masks lie beside photos as instant-ngp has them
/// (dynamic_mask_NAME.png), which mean the contrary and are not read.
void warn_of_masks(const std::vector<View>& views, const std::filesystem::path& root);

/// Throws DataError unless the mask has the photo's shape, not necessarily its size; it may be
/// turned as EXIF says.
void check_mask(const View& view);

}  // namespace raysplats::io
