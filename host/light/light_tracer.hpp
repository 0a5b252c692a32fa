// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats {

/// Draws a scene of Gaussians and meshes after docs/light.md: paths advance one surface at a time,
/// all of a picture's together, as waves of rays without the ones that have ended.
class LightTracer {
 public:
  /// Rays of the last render().
  struct Statistics {
    std::uint64_t camera_rays = 0;
    std::uint64_t continued_rays = 0;  ///< behind mirrors, glass, transparent and diffuse surfaces
    std::uint64_t shadow_rays = 0;     ///< from surfaces and Gaussians
    std::uint64_t capped_rays = 0;     ///< stopped because of TraceOptions::max_hits
    std::uint64_t ended_by_bounces = 0;  ///< paths that max_bounces ended
  };

  /// Uploads the scene and builds both trees. Throws UsageError for settings out of range,
  /// DataError for meshes with a non-finite number or an index out of range.
  LightTracer(Context& context, const Scene& scene);
  ~LightTracer();

  /// The same materials and Gaussians with other meshes (an animation's next frame).
  void set_meshes(const std::vector<Mesh>& meshes);

  /// RGBA: the background or environment is blended, alpha is the share of light that did not come
  /// from there. Any camera model.
  Image render(const Camera& camera);

  Statistics statistics() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
