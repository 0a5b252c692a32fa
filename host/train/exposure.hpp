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

  /// For steps of `slots` views.
  Exposure(Context& context, std::size_t views, std::size_t slots = 1);

  /// The picture as the photo of `view` shows it: planar R, G, B, A; A is copied. Valid until the
  /// next call.
  const Buffer<float>& apply(const Buffer<float>& image, std::size_t view, int width, int height);

  /// For the last apply() of the same picture: turns dL of its result (planar; A is left alone)
  /// into dL of the picture in place, and keeps dL of the photo's numbers as those of a step's view
  /// `slot`. Enqueues without waiting, as step() does.
  void backward(const Buffer<float>& image,
                Buffer<float>& gradient,
                std::size_t view,
                int width,
                int height,
                std::size_t slot = 0);
  /// What backward() has kept: kNumbers a slot.
  Buffer<float>& gradients() { return sums_; }
  /// One step of Adam (0.9, 0.999) at `rate` by what backward() kept, unless the guard is marked.
  void step(std::size_t view, std::size_t slot, double rate, const Buffer<std::uint32_t>& guard);

  /// Blocks.
  State state() const;
  /// Throws DataError when it is not of as many photos.
  void restore(const State& state);

 private:
  Context& context_;
  std::size_t views_;
  Kernel apply_, gradient_, sum_, step_;
  Buffer<float> deltas_, first_, second_, steps_, picture_, partials_;
  Buffer<float> sums_;  // of every slot
};

}  // namespace raysplats
