// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/gradient_sums.hpp"
#include "trace/launch_budget.hpp"
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

  /// The screen of a camera. Pinhole and kOpenCv: the gradient of the projected mean as
  /// CameraTracer yields it (for Gaussians that are small against their distance). Others:
  /// |dL/dmean| times distance times width / (2 fx), where an equirectangular picture has 2 pi
  /// radians across and an orthographic one knows no distance.
  static RayScreen of(const Camera& camera);
};

/// Gradients of a loss over arbitrary rays for the parameters of the Gaussians. begin(), any number
/// of add(), finish(): the segments of a path add up. The Gaussians and the tracer's tree stay as
/// they are meanwhile; min_transmittance, max_hits, the order of hits and the way of adding are the
/// tracer's.
class RayBackward {
 public:
  /// Of what a ray met: dL/d(R, G, B) of its colour, dL/dalpha.
  using ResultGradient = std::array<float, 4>;
  /// Gradient of a ray: dL/dorigin in 0..2, dL/ddirection in 4..6 (of the direction as it is, which
  /// need not have unit length), zeros. The ends t_min and t_max stay where they are along the ray.
  using PaddedRayGradient = std::array<float, 8>;

  /// `tracer` is not owned.
  RayBackward(Context& context, const RayTracer& tracer);

  /// Rays that one begin() may take, unless it is told fewer.
  static constexpr std::size_t kMostRays = std::size_t{1} << 32;

  /// `rays` is at least the number that all add() together will bring: the fewer, the larger the
  /// gradients that exact sums take (GradientSums::limit()).
  void begin(const DeviceGaussians& gaussians,
             const RayScreen& screen = {},
             std::size_t rays = kMostRays);
  /// The first `count` of `rays` again, with the `results` that the tracer gave them (background
  /// included) and the gradients of those. With `ray_gradients`, which grows as needed, the first
  /// `count` of these become the gradients of the rays. Enqueues and returns. Throws UsageError
  /// without begin(), for more rays than it was told, and for buffers that are too small.
  void add(const DeviceGaussians& gaussians,
           const Buffer<Ray>& rays,
           std::size_t count,
           const Buffer<RayResult>& results,
           const Buffer<ResultGradient>& gradients,
           ColorDirection color_direction,
           Buffer<PaddedRayGradient>* ray_gradients = nullptr);
  /// As RayTracer::set_watch(), of add(), which then waits; begin() has to follow one that ended
  /// so.
  void set_watch(std::function<void(double share)> watch);
  /// Overwrites `gradients`, growing its buffers as needed.
  void finish(const DeviceGaussians& gaussians, GaussianGradients& gradients);

  /// Lines of 16 floats that are summed per Gaussian, and how.
  static std::size_t sum_lines(int sh_degree);
  static GradientSumChoice sum_choice(const TraceOptions& options,
                                      const DeviceInfo& device,
                                      std::size_t gaussians,
                                      int sh_degree);

 private:
  Context* context_;
  const RayTracer* tracer_;
  RayOrder order_;
  bool begun_ = false;
  int degree_ = 0;
  RsRaySums shares_{};
  std::size_t count_ = 0;  // Gaussians of begin()
  std::uint64_t revision_ = 0;
  std::size_t rays_ = 0;   // that begin() was told
  std::size_t taken_ = 0;  // of these
  Buffer<float> records_;
  Buffer<PaddedRayGradient> no_ray_gradients_;
  GradientSums sums_;
  LaunchBudget budget_;
};

}  // namespace raysplats
