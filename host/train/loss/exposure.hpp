// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "train/loss/device_photo.hpp"

namespace raysplats {

/// An affine colour per photo (3 x 4: a matrix and an offset), found beside the model, so that
/// exposure and white balance that change from photo to photo need no Gaussians. What is kept is
/// the difference from the identity, row by row; its mean over the photos that steps show is zero
/// after every step, so the model's own colours are those of the average photo. A step is the least
/// squares fit of the picture to its photo, held back by a damping: few visits of a photo suffice,
/// and what its colours do not tell stays as it is. Where photos are cut out it is the Gaussians'
/// light that has the affine colour, and not the background behind them (docs/training.md,
/// Exposure). Sums are taken in a fixed order: equal inputs give equal bits.
class Exposure {
 public:
  static constexpr std::size_t kNumbers = 12;
  static constexpr std::size_t kSums = 24;  ///< that say what a picture and its photo tell

  /// For steps of `slots` views. `cut_out`: the photos' alpha is coverage, as in
  /// ImageLoss::evaluate(). `apart`: views that steps do not show at first (step()).
  Exposure(Context& context,
           std::size_t views,
           std::size_t slots = 1,
           bool cut_out = false,
           std::span<const std::size_t> apart = {});

  /// The picture, over `background`, as the photo of `view` shows it: planar R, G, B, A; A is
  /// copied. Valid until the next call.
  const Buffer<float>& apply(const Buffer<float>& image,
                             std::size_t view,
                             std::array<float, 3> background,
                             int width,
                             int height);

  /// Turns dL of the result of apply() (planar) into dL of the picture in place; A is left alone
  /// but where photos are cut out. Enqueues without waiting, as observe() and step() do.
  void backward(Buffer<float>& gradient,
                std::size_t view,
                std::array<float, 3> background,
                int width,
                int height);
  /// Keeps what the picture (not the result of apply()) and its photo say of the photo's numbers as
  /// those of a step's view `slot`.
  void observe(const Buffer<float>& image,
               const DevicePhoto& photo,
               std::array<float, 3> background,
               int width,
               int height,
               std::size_t slot = 0);
  /// What observe() has kept: kSums a slot.
  Buffer<float>& sums() { return sums_; }
  /// Fits the photo's numbers to what observe() kept, unless the guard is marked: they minimise the
  /// mean squared error of the colours + damping x their squared distance from where they were.
  /// Until they have `joined`, views that are apart keep what they have, and no part in the mean.
  void step(std::size_t view,
            std::size_t slot,
            double damping,
            const Buffer<std::uint32_t>& guard,
            bool joined = true);

  /// What the sums of a picture and its photo tell of them, means of R, G and B over what counts.
  struct Tale {
    double removable = 0;  ///< what an affine colour takes off the mean squared error at most
    double variance = 0;   ///< of the photo's colours; where photos are cut out, of its light
  };
  /// By what observe() has kept in `slot`, and the mean squared error of the picture. Blocks.
  Tale tale(double error, std::size_t slot = 0) const;

  /// The differences of all photos, 12 numbers each. Blocks.
  std::vector<float> deltas() const { return deltas_.download(); }
  /// Throws DataError when they are not of as many photos.
  void restore(const std::vector<float>& deltas);

 private:
  Context& context_;
  std::size_t views_;
  std::size_t apart_;  // of them
  bool cut_out_;
  Kernel apply_, backward_, moments_, sum_, solve_;
  Buffer<float> deltas_, picture_, partials_;
  Buffer<float> sums_;           // of every slot
  Buffer<std::uint32_t> waits_;  // of every view: whether it is apart
};

}  // namespace raysplats
