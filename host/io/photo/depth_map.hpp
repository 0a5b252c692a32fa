// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Depths of a picture, row by row; 0 where nothing is known.
struct DepthMap {
  int width = 0;
  int height = 0;
  std::vector<float> values;
};

/// Reads depths: a picture of one channel with integers of 16 bits or more, as they are, or floats,
/// or a .npy file of height x width numbers (read_npy(); one channel more is fine), each number
/// times `unit`. Numbers that are not finite or not above 0 are unknown; those that are not finite
/// are counted in a warning. Throws DataError for another format or shape. `again`: it was read
/// before, and what was said of it then is not repeated.
DepthMap read_depth_map(const std::filesystem::path& path, double unit, bool again = false);

/// What is known of the depths of a view at the size of its camera: from its depth map where it has
/// one (the nearest pixel, lenses taken out as for its photo), else those of the sparse points that
/// it is known to show; empty without both. Along the viewing axis, for fisheye and
/// equirectangular cameras along the ray (maps of wide photos through lenses of planes, which
/// become fisheye pictures, are turned into that). Throws DataError as read_depth_map() and for a
/// map of another shape than its photo.
DepthMap view_depths(const Dataset& dataset, const View& view, double unit, bool again = false);

/// Reads the depth map of a view, which has one, and throws what view_depths() would throw of it,
/// without making its depths. Returns whether it knows any: a sensor may have measured nothing.
bool check_depth_map(const View& view, double unit);

/// Pixels whose depth is known.
std::size_t count_known(const DepthMap& depths);

/// The same with fewer pixels: the median of what is known in the area of each.
DepthMap reduced(const DepthMap& depths, int width, int height);

}  // namespace raysplats::io
