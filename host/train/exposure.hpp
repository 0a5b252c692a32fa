// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"

namespace raysplats {

/// An affine colour per photo (3 x 4: a matrix and an offset), trained beside the model, so that
/// exposure and white balance that change from photo to photo need no Gaussians. What is kept is
/// the difference from the identity, row by row; its mean over all photos is zero after every step,
/// so the model's own colours are those of the average photo. Sums are taken in a fixed order:
/// equal inputs give equal bits.
class Exposure {
 public:
  static constexpr std::size_t kNumbers = 12;

  /// The whole state: 12 numbers a photo each.
  struct State {
    std::vector<float> deltas, first, second, steps;
  };

  Exposure(Context& context, std::size_t views);

  /// The picture as the photo of `view` shows it: planar R, G, B, A; A is copied. Valid until the
  /// next call.
  const Buffer<float>& apply(const Buffer<float>& image, std::size_t view, int width, int height);

  /// For the last apply() of the same picture: turns dL of its result (planar; A is left alone)
  /// into dL of the picture in place, and makes one step of Adam (0.9, 0.999) at `rate` unless the
  /// guard is marked. Enqueues without waiting.
  void step(const Buffer<float>& image,
            Buffer<float>& gradient,
            std::size_t view,
            int width,
            int height,
            double rate,
            const Buffer<std::uint32_t>& guard);

  /// Blocks.
  State state() const;
  /// Throws DataError when it is not of as many photos.
  void restore(const State& state);

 private:
  Context& context_;
  std::size_t views_;
  Kernel apply_, gradient_, step_;
  Buffer<float> deltas_, first_, second_, steps_, picture_, partials_;
};

}  // namespace raysplats
