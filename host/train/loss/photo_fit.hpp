// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"

namespace raysplats {

/// How near a run's pictures were to each training photo when a step last saw it. The host waits
/// for no step.
class PhotoFit {
 public:
  PhotoFit(Context& context, std::size_t views);

  /// Where a step that sees a photo notes it (train/step_guard.cl).
  struct Place {
    Buffer<std::array<float, 2>>& sums;
    std::int32_t view;  ///< -1: it does not
  };
  /// That of a step with the photo of `view`. Steps at full size count alone: others have other
  /// errors.
  Place place(std::size_t view, bool full_size);
  /// As if no step had been.
  void forget();
  /// Decibels per view; NaN where none has seen it or the last one was not at full size. Blocks.
  std::vector<double> psnr() const;

 private:
  Buffer<std::array<float, 2>> sums_;
  std::vector<bool> full_size_;
};

}  // namespace raysplats
