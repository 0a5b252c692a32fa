// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

namespace raysplats {

/// What is captured and how.
enum class SyntheticScene {
  kStillLife,  ///< cameras all around, transparent ground (Blender / NeRF-synthetic)
  kForward,    ///< the still life before a painted wall, all cameras on one side
  kRoom,       ///< the still life in a papered room, the cameras in it too
  kOutdoor,    ///< the still life on a meadow, hills 60 units away, a clouded sky
};

/// Size and variant of a generated data set.
struct SyntheticOptions {
  SyntheticScene scene = SyntheticScene::kStillLife;
  int size = 160;          ///< width and height of every image in pixels, 8 to 4096
  int train_views = 48;    ///< 1 to 10000
  int test_views = 8;      ///< 1 to 10000
  std::uint64_t seed = 0;  ///< varies noise textures, pebbles and the azimuth of the cameras
};

/// Ray-traces a procedural still life (curved, textured and thin parts on a round table top, inside
/// a ball of radius 1.2 around the origin, Z up) and writes it as a Blender / NeRF-synthetic data
/// set: transforms_train.json, transforms_test.json, train/r_N.png and test/r_N.png (RGBA, straight
/// alpha, transparent where nothing is hit). The cameras lie 4 units from the origin above the
/// table top and look at the origin; the held-out views lie between the training views. Equal
/// options give equal bytes. The other scenes have opaque photos (train/r_N.png, test/r_N.png, RGB)
/// in a nerfstudio data set without points: transforms.json, which names the held-out views. Throws
/// UsageError for options outside their range and, without `overwrite`, when `directory` holds
/// anything but an earlier data set of this function, DataError when it cannot be written.
void generate_dataset(const std::filesystem::path& directory,
                      const SyntheticOptions& options = {},
                      bool overwrite = false);

}  // namespace raysplats
