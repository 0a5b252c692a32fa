// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"
#include "synth/bench_scenes.hpp"

namespace raysplats::peer {

/// What one run of a contestant gave.
struct Outcome {
  double seconds = 0.0;
  double hits_per_ray = 0.0;
  double traces_per_ray = 1.0;               ///< traversals; 1 where a ray needs no second
  std::vector<std::array<float, 3>> colors;  ///< per pixel or ray, on black; empty for builds
};

/// One of the programs that do the same work.
struct Contestant {
  std::string name;
  std::function<Outcome()> run;
};

/// All runs of one contestant.
struct Result {
  std::string name;
  double median_ms = 0.0;
  double min_ms = 0.0;
  Outcome last;
  double mean_color = 0.0;
  double max_difference = 0.0;   ///< largest colour difference from the first contestant
  double mean_difference = 0.0;  ///< mean absolute colour difference from the first contestant
};

/// Runs every contestant once unmeasured and then `repeat` times in turn.
std::vector<Result> run_in_turn(const std::vector<Contestant>& contestants, int repeat);

/// Rays of a pinhole camera as packets of 4x4 pixels within tiles of 16x16, in steps of (X, Y, 1)
/// in camera axes as CameraTracer's.
struct CameraRays {
  std::vector<Ray> rays;            ///< a multiple of 16; pixels beyond the image repeat an edge
  std::vector<std::size_t> pixels;  ///< row-major pixel of every ray, npos beyond the image
  static constexpr std::size_t npos = ~std::size_t{0};
};
CameraRays camera_rays(const Camera& camera);

/// RaySplats' own tracers and tree with wall-clock times, finished on the device.
class OurTracer {
 public:
  OurTracer(const std::string& device, const Gaussians& model, const TraceOptions& options);
  ~OurTracer();
  std::string device_name() const;
  /// Candidate lists and tracing of one view; the image stays on the device while time runs.
  Outcome camera(const Camera& camera);
  /// Transfer of the rays, tracing, transfer of the results.
  Outcome rays(std::span<const Ray> rays);
  /// The tree that rays walk, from the Gaussians on the device: RayTracer::update() and refit().
  Outcome build();
  Outcome refit();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats::peer
