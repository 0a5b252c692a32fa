// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>

#include "raysplats/image.hpp"

namespace raysplats {

/// Learned perceptual distance (Zhang et al. 2018) by a network that the user supplies as an ONNX
/// file: two image inputs (1, 3, height, width), RGB in [-1, 1], and one number out. Needs a build
/// with OpenCV's DNN module.
class Lpips {
 public:
  /// Whether this build can run networks.
  static bool available();

  /// Throws UsageError in a build without OpenCV, DataError for a file that is no such network or
  /// one that OpenCV would compute wrongly; scripts/quality/export_lpips.py writes a right one.
  explicit Lpips(const std::filesystem::path& network);
  ~Lpips();
  Lpips(Lpips&&) noexcept;
  Lpips& operator=(Lpips&&) noexcept;

  /// Distance of two RGB images in [0, 1]; 0 = equal. Throws UsageError when the sizes differ or
  /// the numbers are fewer or more than they say, DataError when the network does not take the size
  /// or yields anything but one finite number.
  double distance(const Image& image, const Image& photo);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
