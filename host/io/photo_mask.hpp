// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <set>
#include <string>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Where masks lie that nothing names; ScanNet++ has a name of its own.
std::filesystem::path mask_folder(const std::filesystem::path& root);

/// Finds masks that nothing names, in mask_folder() and nowhere else, by the names of their photos.
class MaskFinder {
 public:
  explicit MaskFinder(const std::filesystem::path& root);

  /// A photo of the data set, with its folders; what looks alike in several tells of none.
  void add(const std::filesystem::path& name);

  /// The mask of a photo, empty where there is none: COLMAP's name.ext.png, or an image that is
  /// called as the photo, with "_mask" or ".mask" behind it or without. The name counts as a whole,
  /// then without the folder that all photos share, then as far as no other photo's path ends so,
  /// the longest first. Of a name that is absolute or leads upwards inner_name() counts.
  std::filesystem::path find(const std::filesystem::path& name) const;

 private:
  std::filesystem::path folder_;             // empty where there is none
  std::set<std::string> photos_;             // inner_name() of each
  std::map<std::string, std::size_t> ends_;  // how many paths end so, without extensions
  std::string shared_;                       // the folder that all lie in; may be empty
};

/// Throws DataError unless the mask has the photo's shape, not necessarily its size; it may be
/// turned as EXIF says.
void check_mask(const View& view);

}  // namespace raysplats::io
