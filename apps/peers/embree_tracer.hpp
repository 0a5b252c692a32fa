// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <embree3/rtcore.h>

#include <cstdint>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "synth/bench_scenes.hpp"

namespace raysplats::peer {

/// What Embree's callbacks read of a Gaussian: one cache line.
struct alignas(64) EmbreeGaussian {
  float rows[9];  ///< of the whitening matrix S^-1 R^T
  float mean[3];
  float rgb[3];  ///< colour of the SH degree 0 band
  float opacity;
};

struct EmbreeBox {
  float lo[3], hi[3];
};

enum class EmbreeRays {
  kSingle,   ///< rtcIntersect1, one ray after the other
  kPackets,  ///< rtcIntersect16, 16 neighbours of the span together
};

struct EmbreeTraceOptions {
  EmbreeRays rays = EmbreeRays::kPackets;
  int capacity = 64;  ///< hits that a ray gathers per traversal (K): 16 or 64
};

struct EmbreeResult {
  float color[3];
  float transmittance;
  std::uint32_t hits;    ///< blended
  std::uint32_t traces;  ///< traversals that the ray took
};

/// Ray-traced Gaussians (docs/model.md) as one would write them on Embree 3: user geometry over the
/// exact boxes of the ellipsoids; each traversal gathers the nearest `capacity` hits of a ray in
/// order of (near root, index) in the intersect callback, which shortens the ray once they are full
/// (k-buffer); blending in that order; the next traversal starts behind the last blended hit. The
/// colours are those of SH degree 0.
class EmbreeTracer {
 public:
  /// Prepares records and boxes; `threads` for Embree's builders and for tracing.
  EmbreeTracer(const Gaussians& model, float quantile, float min_transmittance, int threads);

  /// Builds the tree from the boxes and returns the seconds it took: RTC_BUILD_QUALITY_LOW (Morton
  /// codes), RTC_BUILD_QUALITY_MEDIUM (binned SAH).
  double build(RTCBuildQuality quality);
  /// Seconds of an update with RTC_BUILD_QUALITY_REFIT of a tree built with MEDIUM quality.
  double refit();

  /// Traces rays through the tree of the last build(). The number of rays must be a multiple of 16.
  std::vector<EmbreeResult> trace(std::span<const Ray> rays,
                                  const EmbreeTraceOptions& options) const;

 private:
  struct DeviceRelease {
    void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
  };
  struct SceneRelease {
    void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
  };
  using Device = std::unique_ptr<std::remove_pointer_t<RTCDevice>, DeviceRelease>;
  using Scene = std::unique_ptr<std::remove_pointer_t<RTCScene>, SceneRelease>;

  Scene make_scene(RTCBuildQuality quality, RTCSceneFlags flags);
  void check(const char* action) const;

  float min_transmittance_;
  int threads_;
  std::vector<EmbreeGaussian> gaussians_;
  std::vector<EmbreeBox> boxes_;
  float quantile_;
  Device device_;
  Scene scene_;
};

}  // namespace raysplats::peer
