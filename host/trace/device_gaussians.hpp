// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/context.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/parameters.hpp"

namespace raysplats {

/// The trained parameters on the device. `scales` hold the parameter before `activation`: log-scale
/// for kExp, logit of the scale for kSigmoid.
struct DeviceGaussians : Parameters {
  std::size_t count = 0;
  int sh_degree = 0;  ///< degree the sh buffer is laid out for
  int active_sh_degree =
      0;  ///< bands above this are not evaluated (they are switched on over time)
  ScaleActivation activation = ScaleActivation::kExp;
  /// The number of this state of the parameters, from Context::new_revision(). What is made of them
  /// (boxes, trees) remembers it, and is stale when it differs.
  std::uint64_t revision = 0;

  /// Copies a host model to the device. For kSigmoid a scale of 1 or more is clamped just below 1.
  static DeviceGaussians upload(Context& context,
                                const Gaussians& model,
                                ScaleActivation activation);
  Gaussians download() const;
  /// To be called by whoever writes to the buffers.
  void changed(Context& context) { revision = context.new_revision(); }
};

/// Gradient of the loss for every parameter and what densification needs.
struct GaussianGradients : Parameters {
  /// For each Gaussian of a view {norm of the gradient at the projected mean in normalised device
  /// coordinates (as 3DGS), the same from absolute values per ray (as AbsGS), 1 when any ray met it
  /// else 0, by how much the rays that met it in pixels with a gradient blend more of it than
  /// TraceOptions::least_weight, in sum}. Where the ellipsoid reaches the plane of a view's camera
  /// the first two and the last are 0.
  static constexpr std::size_t kScreenNumbers = 4;
  Buffer<float> screen;  ///< 4 N

  /// RS_GRADIENT_ARGUMENTS of cl/trace/arguments.h.
  auto arguments() const {
    return argument_pack(means, quaternions, scales, opacities, sh, screen);
  }
  /// Makes room for those of `gaussians`; what is in them is lost where they have to grow.
  void ensure(Context& context, const DeviceGaussians& gaussians);
};

}  // namespace raysplats
