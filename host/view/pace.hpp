// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"

namespace raysplats::view {

/// Chooses how large pictures are while the camera moves, from the time that the last ones took: a
/// part that any picture takes (the lists of a large model), and one that grows with its pixels.
class Pace {
 public:
  /// `seconds` per picture.
  explicit Pace(double seconds) : seconds_(seconds) {}

  /// The camera at a size that should take that long, at most its own. Where any picture takes
  /// more than half of that, the pixels have half of it all the same: smaller ones would hardly be
  /// quicker.
  Camera sized(const Camera& camera) const;
  /// A picture of `pixels` pixels took `seconds`.
  void record(double pixels, double seconds);

 private:
  double seconds_;
  double pixels_ = 320.0 * 240.0;
  double fixed_ = 0.0;  // seconds that any picture takes
  // Sums over the last pictures, older ones counting less: number, pixels, squares, seconds,
  // products.
  double number_ = 0, sum_pixels_ = 0, sum_squares_ = 0, sum_seconds_ = 0, sum_products_ = 0;
};

}  // namespace raysplats::view
