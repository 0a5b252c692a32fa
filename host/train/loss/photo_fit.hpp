// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "train/loss/image_loss.hpp"

namespace raysplats {

/// How near a run's pictures were to each training photo when a step last saw it. The host waits
/// for no step.
class PhotoFit {
 public:
  PhotoFit(Context& context, std::size_t views);

  /// A step has seen the photo of `view` (enqueues). Steps at full size count alone: others have
  /// other errors.
  void note(std::size_t view,
            bool full_size,
            const ImageLoss::Partials& loss,
            const Buffer<std::uint32_t>& overflow);
  /// As if no step had been.
  void forget();
  /// Decibels per view; NaN where none has seen it or the last one was not at full size. Blocks.
  std::vector<double> psnr() const;

 private:
  Kernel note_;
  Buffer<std::array<float, 2>> sums_;
  std::vector<bool> full_size_;
};

}  // namespace raysplats
