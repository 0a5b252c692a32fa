// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// What 3DGS-MCMC (Kheradmand et al. 2024) does in every step beside the gradient's: see
/// cl/train/mcmc.cl. Both are free of scale: sizes count in units of `length` (subject_length()).
/// Everything random is a function of seed, iteration and Gaussian.
class Mcmc {
 public:
  Mcmc(Context& context, const TrainOptions& options, double length);

  /// Adds the gradients of opacity-reg times the mean opacity and of scale-reg times the mean
  /// standard deviation over the length.
  void add_regularisation(const DeviceGaussians& gaussians,
                          GaussianGradients& gradients,
                          const Buffer<std::uint32_t>& guard);

  /// After the step of `iteration`: moves the means of faint Gaussians by mcmc-noise times their
  /// covariance over the length times normal numbers; as position-lr falls, so does this.
  void add_noise(DeviceGaussians& gaussians,
                 std::int64_t iteration,
                 const Buffer<std::uint32_t>& guard);

 private:
  Context& context_;
  const TrainOptions& options_;  // the run's: iterations may be fixed after this was made
  double length_;
};

/// Gives every Gaussian its share (RelocationPlan::shares); enqueues without waiting.
void apply_shares(Context& context,
                  std::span<const std::array<float, 2>> shares,
                  DeviceGaussians& gaussians);

}  // namespace raysplats
