// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/rays.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/ray_layout.h"
#include "trace/device_gaussians.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tree.hpp"

namespace raysplats {

/// Traces arbitrary rays: any origins and directions, without coherence. The order of hits is exact
/// per ray; near_depth and depth of the options have no meaning here, but see set_near(). With a
/// view_footprint rays may be cones (cl/trace/ray_cone.h), which takes half more memory for a
/// Gaussian and more time; its gradients are not known.
class RayTracer {
 public:
  RayTracer(Context& context, const TraceOptions& options);
  /// In another form than the device's tree_form(). Throws UsageError for one that there is not.
  RayTracer(Context& context, const TraceOptions& options, const TreeForm& form);
  ~RayTracer();

  /// Builds the tree. It, refit() or follow() must come after every change of the Gaussians.
  void update(const DeviceGaussians& gaussians);
  /// Cheaper than update() for Gaussians that moved little; the results are the same, rays are
  /// slower the farther they moved. Throws UsageError when their number changed.
  void refit(const DeviceGaussians& gaussians);
  /// update() or refit(), whichever the measured growth of the tree asks for (RayTree::follow()),
  /// where the Gaussians changed since, else nothing. Returns whether it was update().
  bool follow(const DeviceGaussians& gaussians);

  std::vector<RayResult> trace(const DeviceGaussians& gaussians,
                               std::span<const Ray> rays,
                               ColorDirection color_direction = ColorDirection::kRay);
  /// The first `count` of `rays`, already on the device, into the first of `results`, which grows
  /// when it is smaller. `cones`: of each ray, by CameraRays::cones(); without any, rays see the
  /// Gaussians as they are. Enqueues and returns, unless the options bound the time of a launch.
  /// Throws UsageError for cones where the options have no view_footprint.
  void trace(const DeviceGaussians& gaussians,
             const Buffer<Ray>& rays,
             std::size_t count,
             Buffer<RayResult>& results,
             ColorDirection color_direction = ColorDirection::kRay,
             const Buffer<RsCone>* cones = nullptr);
  /// The same for paths: colours from the origin for rays whose from_origin is 1, along the ray
  /// where it is 0, and instead of the number of hits the Gaussian that leads them: the one of the
  /// median depth, or the one that shows most where there is none.
  void trace(const DeviceGaussians& gaussians,
             const Buffer<Ray>& rays,
             const Buffer<std::uint32_t>& from_origin,
             std::size_t count,
             Buffer<RayResult>& results,
             const Buffer<RsCone>* cones = nullptr);

  /// Colour behind the Gaussians from the next trace() on.
  void set_background(const std::array<float, 3>& background);
  /// What rays do not meet from the next trace() on; RayBackward follows.
  void set_near(const RayNear& near);
  const RayNear& near() const;
  /// Lets `watch` hear, from the next trace() on, the share of its rays that is done after every
  /// launch, which then are short ones; what it throws ends trace(). Nothing is heard with {}.
  void set_watch(std::function<void(double share)> watch);
  const TraceOptions& options() const;
  /// Throws UsageError unless the tree is that of these Gaussians as they are now.
  void require_current(const DeviceGaussians& gaussians) const;
  /// Rays of the next trace() tell in place of their depths how many nodes (`depth`) and blocks
  /// (`median_depth`) they tested, for the model of speed.
  void count_work();
  /// The tree of the last update() or refit().
  const RayTree& tree() const;

 private:
  void launch(const DeviceGaussians& gaussians,
              const Buffer<Ray>& rays,
              std::size_t count,
              Buffer<RayResult>& results,
              std::int32_t color_mode,
              const Buffer<std::uint32_t>& from_origin,
              const Buffer<RsCone>* cones);

  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
