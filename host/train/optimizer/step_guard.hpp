// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/context.hpp"
#include "light/view_tracer.hpp"
#include "train/loss/image_loss.hpp"
#include "train/loss/photo_fit.hpp"

namespace raysplats {

/// Keeps training steps that are not finite from reaching the model, without the host waiting for
/// any of them: a step whose loss is not finite changes nothing, and a Gaussian whose gradient is
/// not finite keeps its parameters (Adam). Steps of the first kind, and those in which more than
/// one Gaussian in a thousand refused its gradient, are bad; after kLimit in a row nothing changes
/// any more, so that the model stays as it was until the host looks. A step whose view had no room
/// (ViewTracer::overflow()) changes nothing either and counts as if it had not been.
class StepGuard {
 public:
  static constexpr std::uint32_t kLimit = 10;

  struct Counts {
    std::uint32_t in_a_row = 0;
    std::uint32_t bad_steps = 0;
    bool stopped = false;
    std::uint64_t capped_rays = 0;  ///< of all steps, that the cap on hits stopped
  };

  explicit StepGuard(Context& context);

  /// A view of the present step whose loss is known, before its backward pass. Marks the step when
  /// the sums of the loss are not finite, or the word of `overflow` is not 0; adds `capped` to the
  /// rays of the step that the cap on hits stopped, which begin anew with the first view; and notes
  /// in `fit` how near the picture was to its photo.
  void check_view(const ImageLoss::Partials& loss,
                  const Buffer<std::uint32_t>& overflow,
                  const ViewTracer::CappedRays& capped,
                  const PhotoFit::Place& fit,
                  bool first);
  /// After the update: counts. `refused` is Adam's count of refused gradients, `count` the
  /// Gaussians.
  void close(const Buffer<std::uint32_t>& refused, std::size_t count);

  /// Not 0 in its first word: the kernels of this step change nothing.
  const Buffer<std::uint32_t>& mark() const { return state_; }
  /// The word, which ranks that share a step agree on; blocks. With a bit of RS_GUARD_REPEATED
  /// close() counts nothing.
  std::uint32_t marked() const { return state_.read(0); }
  void set_mark(std::uint32_t word);
  /// Rays of the step that the cap on hits stopped, which they add up; blocks.
  std::uint64_t step_capped() const;
  void set_step_capped(std::uint64_t rays);
  /// Blocks.
  Counts counts() const;
  /// Goes on counting from a checkpoint.
  void restore(const Counts& counts);

 private:
  Kernel check_, close_;
  Buffer<std::uint32_t> state_;
};

}  // namespace raysplats
