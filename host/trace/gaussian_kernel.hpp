// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "device/build_options.hpp"
#include "device/context.hpp"
#include "device/kernel.hpp"

namespace raysplats {

/// A kernel of LANES Gaussians per work-item (cl/trace/gaussian_lanes.h): vectors as wide as the
/// device's on CPUs, single Gaussians elsewhere. Its first arguments are the numbers of the first
/// Gaussian and of the one behind the last.
class GaussianKernel {
 public:
  GaussianKernel() = default;
  GaussianKernel(Context& context,
                 const std::string& file,
                 const std::string& name,
                 const BuildOptions& build);

  /// Runs on `count` Gaussians; what does not fill a vector runs in a build of single Gaussians.
  template <class... Arguments>
  void launch(std::size_t count, const Arguments&... arguments) {
    const std::size_t whole = count / width_ * width_;
    if (whole > 0) {
      wide_.launch(Range::linear(whole / width_, group_), std::uint32_t{0},
                   static_cast<std::uint32_t>(whole), arguments...);
    }
    if (count > whole) {
      single_.launch(Range::linear(count - whole, group_), static_cast<std::uint32_t>(whole),
                     static_cast<std::uint32_t>(count), arguments...);
    }
  }

 private:
  std::size_t width_ = 1;
  std::size_t group_ = 1;  // work-items
  Kernel wide_;
  Kernel single_;
};

}  // namespace raysplats
