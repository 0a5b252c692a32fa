// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "light/surface_store.hpp"
#include "parallel/scan.hpp"
#include "raysplats/mirrors.hpp"
#include "trace/ray_backward.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// Rays through Gaussians that mirrors turn (docs/light.md), with gradients: the segments of a path
/// are traced one after the other, all paths of a batch together, and without the ones that ended.
/// The tracer must have a black background; here it is an argument.
class MirrorPaths {
 public:
  /// `tracer` is not owned. Throws as SurfaceStore, UsageError for a negative number of bounces.
  MirrorPaths(Context& context, RayTracer& tracer, const Mirrors& mirrors);

  /// Rays of the batch that comes next: to be filled by the caller, their ends move to the mirrors.
  Buffer<Ray>& rays() { return levels_[0].rays; }
  /// Their cones, to be filled as well where the tracer's options have a view_footprint.
  Buffer<RsCone>& cones() { return levels_[0].cones; }
  /// Traces the first `count` of rays(). `direction` is that of colours before the first mirror;
  /// behind it they follow the ray. `capped`, a 64-bit count in two words
  /// (cl/parallel/counter.h), grows by the rays that stopped because of max_hits.
  void trace(const DeviceGaussians& gaussians,
             std::size_t count,
             ColorDirection direction,
             const std::array<float, 3>& background,
             const Buffer<std::uint32_t>& capped);
  /// Rays of the last trace() that mirrors have reflected.
  std::uint64_t reflected_rays() const;
  /// What the rays saw: colour with the background, and coverage.
  const Buffer<std::array<float, 4>>& seen() const { return levels_[0].seen; }
  /// What they met before the first mirror, over black.
  const Buffer<RayResult>& results() const { return levels_[0].results; }

  /// Gradients of seen(), `count` of them, to be filled by the caller before backward().
  Buffer<RayBackward::ResultGradient>& gradients() { return levels_[0].gradients; }
  /// Adds the gradients of the last trace() to `sums`. `ray_gradients`: as RayBackward::add(), for
  /// rays() as they are made; UsageError with mirrors.
  void backward(const DeviceGaussians& gaussians,
                RayBackward& sums,
                Buffer<RayBackward::PaddedRayGradient>* ray_gradients = nullptr);

  bool has_mirrors() const { return surfaces_ != nullptr; }
  /// Most rays that come of one: itself and its reflections.
  std::size_t segments() const { return levels_.size(); }

 private:
  struct Level {
    std::size_t count = 0;
    Buffer<Ray> rays;
    Buffer<RsCone> cones;
    Buffer<RsPath> paths;
    Buffer<RsSurfaceHit> hits;
    Buffer<std::uint32_t> starts;
    Buffer<RayResult> results;
    Buffer<std::array<float, 4>> seen;
    Buffer<RayBackward::ResultGradient> gradients;
  };

  std::size_t find_mirrors(std::size_t level);
  Kernel kernel(const char* name) const;

  Context* context_;
  RayTracer* tracer_;
  int max_bounces_;
  std::unique_ptr<SurfaceStore> surfaces_;  // null without mirrors
  Scan scan_;
  std::vector<Level> levels_;
  std::size_t used_ = 0;  // levels of the last trace()
  ColorDirection direction_ = ColorDirection::kRay;
  std::array<float, 4> background_{};
  // Stand for what there is not.
  Buffer<RsCone> no_cones_;
  Buffer<RsSurfaceHit> no_hits_;
  Buffer<std::uint32_t> no_words_;
  Buffer<RsMaterial> no_materials_;
  Buffer<std::array<float, 4>> no_colors_;
};

}  // namespace raysplats
