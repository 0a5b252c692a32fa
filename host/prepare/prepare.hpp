// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace raysplats {

/// How photos are compared with each other.
enum class Matching {
  kAuto,        ///< sequential for videos and more than kMostExhaustive photos
  kExhaustive,  ///< every pair
  kSequential,  ///< neighbours in the order of the names
};

/// Which photos were taken by one camera, whose lens they find out together.
enum class Cameras {
  kSize,    ///< those of equal width and height
  kFolder,  ///< likewise, in one folder
  kPhoto,   ///< each has its own
};

struct PrepareOptions {
  std::size_t frames = 150;  ///< of a video
  int max_size = 1600;       ///< longer side at which features are looked for, pixels
  int features = 0;          ///< at most, of a photo; 0 = by the number of photos
  Matching matching = Matching::kAuto;
  Cameras cameras = Cameras::kSize;
  bool subfolders = false;              ///< photos in folders below are taken too
  std::string camera_model = "OPENCV";  ///< one of COLMAP's that read_colmap_model() knows
};

constexpr std::size_t kMostExhaustive = 400;

/// What came of it.
struct Prepared {
  std::size_t photos = 0;
  std::vector<std::string> without_pose;  ///< photos that COLMAP could not place
  std::size_t points = 0;
};

/// Hears which step runs ("features", ...), how far it is (`total` 0 = unknown), and returns false
/// to stop; what is done by then is kept.
using PrepareWatch =
    std::function<bool(const std::string& step, std::size_t done, std::size_t total)>;

/// Makes a data set of photos (a folder) or a video: `data`/images and `data`/sparse, by the
/// programs colmap and ffmpeg in PATH, whose words are in `data`/prepare.log. A video gives
/// three times as many frames as wanted, and the sharpest of each three is kept. A line of the
/// log says beforehand how long COLMAP will take, roughly, and others what was left out or chosen
/// by the number of photos. Steps that `data` has already from the same input, by its sizes and
/// times of writing, with the same options are not done again. Throws UsageError for a missing
/// program; DataError for inputs that are neither, for a folder without photos, for one that cannot
/// be made or that another run writes to, for a video of unknown length, for data made from
/// something else, and when no pose was found; Error when a program fails or is interrupted.
Prepared prepare_data(const std::filesystem::path& input,
                      const std::filesystem::path& data,
                      const PrepareOptions& options,
                      const PrepareWatch& watch);

}  // namespace raysplats
