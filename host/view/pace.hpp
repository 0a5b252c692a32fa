// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"

namespace raysplats::view {

/// Chooses how large pictures are while the camera moves, from the time that the last ones took.
class Pace {
 public:
  /// `seconds` per picture.
  explicit Pace(double seconds) : seconds_(seconds) {}

  /// The camera at a size that should take that long, at most its own.
  Camera sized(const Camera& camera) const;
  /// A picture of `pixels` pixels took `seconds`.
  void record(double pixels, double seconds);

 private:
  double seconds_;
  double pixels_ = 320.0 * 240.0;
};

}  // namespace raysplats::view
