// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// How the gradient of a mean becomes one on the screen, in normalised device coordinates
/// (GaussianGradients::screen): `rows` times dL/dmean times a distance.
struct RayScreen {
  enum class Distance {
    kStraight,  ///< from `center`
    kDepth,     ///< from `center` along the unit vector `axis`
    kNone,      ///< 1
  };
  Distance distance = Distance::kStraight;
  std::array<double, 3> center{0, 0, 0};
  std::array<double, 3> axis{0, 0, 0};
  std::array<std::array<double, 3>, 3> rows{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};

  /// Of a camera. Pinhole and kOpenCv: the gradient of the projected mean as CameraTracer yields it
  /// (for Gaussians that are small against their distance). Others: |dL/dmean| times distance times
  /// width / (2 fx), where an equirectangular picture has 2 pi radians across and an orthographic
  /// one knows no distance.
  static RayScreen of(const Camera& camera);
};

/// Gradients of a loss over arbitrary rays for the parameters of the Gaussians. begin(), any number
/// of add(), finish(): the segments of a path add up. The Gaussians and the tracer's tree stay as
/// they are meanwhile; min_transmittance, max_hits and the order of hits are the tracer's.
class RayBackward {
 public:
  using Gradient = std::array<float, 4>;  ///< of a ray: dL/d(R, G, B) of its colour, dL/dalpha

  /// `tracer` is not owned.
  RayBackward(Context& context, const RayTracer& tracer);

  void begin(const DeviceGaussians& gaussians, const RayScreen& screen = {});
  /// The first `count` of `rays` again, with the `results` that the tracer gave them (background
  /// included) and the gradients of those. Enqueues and returns. Throws UsageError without begin(),
  /// for buffers that are too small, and for ColorDirection::kPerRay.
  void add(const DeviceGaussians& gaussians,
           const Buffer<Ray>& rays,
           std::size_t count,
           const Buffer<RayResult>& results,
           const Buffer<Gradient>& gradients,
           ColorDirection color_direction);
  /// Overwrites `gradients`, growing its buffers as needed.
  void finish(const DeviceGaussians& gaussians, GaussianGradients& gradients);

 private:
  std::array<std::size_t, 2> choose_copies(std::size_t count, std::size_t sums) const;

  Context* context_;
  const RayTracer* tracer_;
  RayOrder order_;
  bool begun_ = false;
  bool private_copies_ = false;
  int degree_ = 0;
  std::array<float, 16> screen_{};
  /// Gaussians, floats of each and copies; the copies behind the first hold zeros outside of
  /// begin() to finish().
  std::array<std::size_t, 3> shape_{};
  Buffer<float> records_;
  Buffer<float> sums_;
};

}  // namespace raysplats
