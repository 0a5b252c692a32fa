// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "prepare/prepare.hpp"

namespace raysplats {

/// Photos that follow one by name and are compared with it where not all pairs are.
constexpr std::size_t kSequentialOverlap = 12;

/// How long the steps take on the cores of this machine, roughly.
struct ColmapSeconds {
  double features = 0, matches = 0, poses = 0;
};

/// What COLMAP is to be called with for a number of photos.
struct ColmapPlan {
  std::size_t photos = 0;
  std::vector<std::vector<std::string>> cameras;  ///< names of the photos of each call
  int features = 0;                               ///< at most, of a photo
  std::string feature_settings;                   ///< equal for plans that find the same
  std::vector<std::string> matcher;               ///< COLMAP's command, and its options
  std::size_t match_lines = 0;                    ///< lines of progress that it prints
  /// Whether the photos of each camera are enough to find where its axis meets the picture.
  bool finds_axis = false;
  ColmapSeconds seconds;
};

/// Reads the sizes of the photos. Throws DataError for one that is no picture.
ColmapPlan plan_colmap(const std::filesystem::path& images,
                       const std::vector<std::string>& photos,
                       const PrepareOptions& options,
                       bool video);

}  // namespace raysplats
