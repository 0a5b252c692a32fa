// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/context.hpp"
#include "train/loss/image_loss.hpp"

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

  /// Marks the present step when the sums of its loss are not finite, or the word of `overflow` is
  /// not 0.
  void check_loss(const ImageLoss::Partials& loss, const Buffer<std::uint32_t>& overflow);
  /// For steps of several views: adds the ViewTracer::kept_capped_rays() of one to step_capped(),
  /// which begins anew with the first.
  void count_capped(const Buffer<std::uint32_t>& capped, bool first);
  const Buffer<std::uint32_t>& step_capped() const { return step_capped_; }
  /// After the update: counts. `refused` is Adam's count of refused gradients, `count` the
  /// Gaussians, `capped` the rays of the step that the cap on hits stopped.
  void close(const Buffer<std::uint32_t>& refused,
             const Buffer<std::uint32_t>& capped,
             std::size_t count);

  /// Not 0 in its first word: the kernels of this step change nothing.
  const Buffer<std::uint32_t>& mark() const { return state_; }
  /// The word, which ranks that share a step agree on; blocks. With a bit of RS_GUARD_REPEATED
  /// close() counts nothing.
  std::uint32_t marked() const { return state_.read(0); }
  void set_mark(std::uint32_t word);
  void set_step_capped(std::uint64_t rays);
  /// Blocks.
  Counts counts() const;
  /// Goes on counting from a checkpoint.
  void restore(const Counts& counts);

 private:
  Context* context_;
  Kernel check_, close_;
  Kernel add_;  // of steps of several views
  Buffer<std::uint32_t> state_, step_capped_;
};

}  // namespace raysplats
