// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/context.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/image.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/model.hpp"
#include "raysplats/pose_gradient.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Gradients of a loss over a picture.
struct ViewGradients {
  /// dL/d(parameter), laid out as the model's: means, quaternions, log_scales, opacities (logits),
  /// sh.
  Gaussians parameters;
  PoseGradient pose;  ///< of the camera; NaN with mirrors and with a sky, where it is not known
  SkyLight sky;       ///< dL/d(TraceOptions::sky); empty without one
};

/// Gradients of a loss over rays.
struct RaysGradients {
  Gaussians parameters;           ///< as in ViewGradients
  std::vector<RayGradient> rays;  ///< of each ray
};

/// Traces Gaussians, forward and backward: pictures of cameras of every model, and rays of your
/// own. What is computed is in docs/model.md; the hits of every ray are blended in exact order
/// (Byrski et al. 2025). The gradients hold the set and the order of the hits fixed. Cameras may
/// look into known mirrors, forward and backward (docs/light.md).
///
/// Units: world units for positions and depths, pixels for focal lengths; colours as they were
/// trained, usually display values in [0, 1]. A tracer notices by itself when a model has changed.
/// Threads: as Context. A tracer remembers its last picture and its last rays: threads that want
/// gradients of their own take tracers of their own, or hold Context::lock() from the forward to
/// the backward pass.
class Tracer {
 public:
  /// Throws UsageError for options and mirrors out of range, and for options.depth,
  /// options.near_depth and Traversal::kTiles beside mirrors, which they do not know.
  explicit Tracer(Context& context, const TraceOptions& options = {}, Mirrors mirrors = {});
  ~Tracer();
  Tracer(Tracer&&) noexcept;
  Tracer& operator=(Tracer&&) noexcept;

  /// RGBA at the camera's size: background blended in, A = 1 - transmittance. `differentiable`
  /// keeps what backward() needs, within options.memory_budget. `within` hears the share of the
  /// picture that is done, several times a second, and returns false to stop; then the picture is
  /// empty. It may use other tracers, not this one. Throws UsageError for a camera without pixels,
  /// with a number that is not finite or with a rotation that scales, shears or mirrors by more
  /// than 1e-3, for a model of another context, and for a camera that Traversal::kTiles cannot
  /// trace.
  Image render(const Model& model,
               const Camera& camera,
               bool differentiable = false,
               const std::function<bool(double share)>& within = {});
  /// Expected depth, median depth and number of hits per pixel of the last picture, 3 channels.
  /// Depth is along the viewing axis for kPinhole, kOpenCv and kOrthographic, along the ray for
  /// other models; 0 where nothing is. Throws UsageError without options.depth.
  Image depth() const;
  /// Where the surfaces that a camera sees point to: 3 channels, the mean of the hits' normals
  /// weighted by what they show, times alpha, in world axes. The normal of a Gaussian is its
  /// shortest axis, turned to the side of the camera's centre (kOrthographic: against its
  /// direction). Traced anew, beside the last picture, which stays; `within` as in render(). Throws
  /// as render(), and UsageError with mirrors.
  Image normals(const Model& model,
                const Camera& camera,
                const std::function<bool(double share)>& within = {});
  /// Gradients of the last picture from dL/d(R, G, B, A), of its size with 4 channels. Throws
  /// UsageError when that was not rendered differentiable, when the model has changed since or is
  /// another one, and for a gradient of another size or with a number that is not finite.
  ViewGradients backward(const Model& model, const Image& gradient);

  /// Rays of any origins and directions. Throws UsageError, naming the ray, for a number that is
  /// not finite (t_max may be infinite), a direction of length 0, and ends that are not
  /// 0 <= t_min <= t_max; for a model of another context; and for options.near_depth, options.sky
  /// and mirrors, which belong to cameras. options.view_footprint means nothing here: these rays
  /// have no pixel. `within` hears the share of the rays that is done, as in render(), and returns
  /// false to stop; then there are no results.
  std::vector<RayResult> trace(const Model& model,
                               std::span<const Ray> rays,
                               ColorDirection direction = ColorDirection::kRay,
                               bool differentiable = false,
                               const std::function<bool(double share)>& within = {});
  /// Gradients of the last rays, one gradient for each of them. Throws as the other backward().
  /// `within` as in trace(): stopped, the gradients are empty, and may be asked for again.
  RaysGradients backward(const Model& model,
                         std::span<const RayResultGradient> gradients,
                         const std::function<bool(double share)>& within = {});

  /// Rays of the last render() or trace() that stopped because of options.max_hits, those that
  /// mirrors have reflected with them.
  std::uint64_t capped_rays() const;
  /// Rays of the last render() that mirrors have reflected; 0 after trace().
  std::uint64_t reflected_rays() const;
  /// The options that it was made with; background and sky as set since.
  const TraceOptions& options() const;
  /// The context that it was made with.
  const Context& context() const;
  /// What is behind everything from the next render() or trace() on: a colour, or a sky in its
  /// place. Throws UsageError for a colour that is not finite, for a sky with mirrors, and for one
  /// whose coefficients are not those of a degree or not finite.
  void set_background(const std::array<float, 3>& background, const SkyLight& sky = {});

  /// Of the library itself: from the next render() that is not differentiable on, trace part `part`
  /// of `parts` equal ones of the picture's rows, and leave the others' pixels open; the rows,
  /// first and last (exclusive), of the last picture.
  void set_share(std::size_t part, std::size_t parts);
  std::array<int, 2> rows() const;

  /// Of the library itself; not installed.
  struct Impl;
  Impl& impl() const { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
