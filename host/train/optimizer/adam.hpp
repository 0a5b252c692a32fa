// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "shared/train_layout.h"
#include "trace/device_gaussians.hpp"

namespace raysplats {

struct AdamOptions {
  double beta1 = 0.9;
  double beta2 = 0.999;
  double epsilon =
      1e-15;  ///< added to the root of the second moment: 3DGS 1e-15, the paper's program 1e-8
  bool visible_only = false;  ///< leave Gaussians alone that no ray of the view met ("sparse Adam")
};

/// Learning rates of one step.
struct AdamRates {
  double means = 0;
  double quaternions = 0;
  double scales = 0;
  double opacities = 0;
  double sh_dc = 0;    ///< first SH coefficient
  double sh_rest = 0;  ///< the others
};

/// Adam (Kingma and Ba 2015) for the parameters of DeviceGaussians: a launch that chooses which
/// Gaussians take the step, and one for all groups of parameters. A Gaussian with any non-finite
/// gradient is left as it was in that step and counted.
class Adam {
 public:
  /// `vector` is the number of floats per vector (1, 4, 8 or 16); 0 = the device's own on CPUs, 1
  /// elsewhere, where neighbouring work-items then touch neighbouring addresses.
  Adam(Context& context, const AdamOptions& options, int vector = 0);

  /// Begins to make the programs of steps of such models.
  void begin_programs(int sh_degree);

  /// Makes moments of zeros for `count` Gaussians and sets steps() to 0.
  void initialize(std::size_t count, int sh_degree);

  /// Applies one step; enqueues without waiting. The first call initialises by itself. Throws
  /// UsageError when the number of Gaussians or SH coefficients is not that of the moments (remap()
  /// or initialize() was forgotten).
  void step(DeviceGaussians& gaussians,
            const GaussianGradients& gradients,
            const AdamRates& rates,
            const Buffer<std::uint32_t>* guard = nullptr);

  /// After densification: Gaussian i continues with the moments of the old Gaussian source[i], or
  /// with zeros when that is RS_NO_SOURCE.
  void remap(const Buffer<std::uint32_t>& source, std::size_t new_count);
  /// Zeroes the moments of one group (after an opacity reset).
  void reset(ParameterGroup group);

  /// Steps done; bias correction depends on it, so checkpoints keep it.
  std::int64_t steps() const { return steps_; }
  void set_steps(std::int64_t steps) { steps_ = steps; }

  /// Moments of all groups, one after the other, each laid out as the parameters and from
  /// moment_place() on. Empty before initialize().
  const Buffer<float>& first_moments() const { return first_; }
  const Buffer<float>& second_moments() const { return second_; }
  std::size_t moment_place(ParameterGroup group) const;
  /// Those of one group; blocks.
  std::vector<float> first_moments(ParameterGroup group) const;
  std::vector<float> second_moments(ParameterGroup group) const;
  /// Uploads both moments of a group; the sizes must be those of initialize().
  void restore(ParameterGroup group, std::span<const float> first, std::span<const float> second);

  /// The same count on the device.
  const Buffer<std::uint32_t>& refused() const { return skipped_; }
  /// Updates skipped since the start because a gradient was not finite; blocks.
  std::uint32_t skipped() const { return skipped_.read(0); }

 private:
  Kernel step_kernel(int sh_degree) const;
  std::size_t floats(ParameterGroup group) const;
  std::size_t slice_size() const;
  // Makes the step of the Gaussians [begin, end); begin is a multiple of slice_size().
  void step_slice(std::size_t begin,
                  std::size_t end,
                  DeviceGaussians& gaussians,
                  const GaussianGradients& gradients,
                  RsAdam record,
                  const Buffer<std::uint32_t>& guard);

  Context& context_;
  AdamOptions options_;
  bool cpu_;
  int lanes_;
  Kernel choose_kernel_, remap_kernel_;
  Buffer<std::uint32_t> skipped_;
  Buffer<std::uint32_t> open_guard_;  // a guard that lets every step pass
  Buffer<std::uint8_t> chosen_;       // Gaussians that take the step
  Buffer<float> first_, second_;      // moments
  bool initialized_ = false;
  std::size_t count_ = 0;
  int sh_degree_ = 0;
  std::int64_t steps_ = 0;
};

}  // namespace raysplats
