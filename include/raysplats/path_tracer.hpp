// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/context.hpp"
#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats {

/// Draws a scene of Gaussians, meshes, materials, lights and an environment by path tracing
/// (docs/light.md): paths advance one surface at a time, all of a picture's together, as waves of
/// rays without the ones that have ended (Laine, Karras and Aila 2013). With one sample per pixel
/// the rays of a camera with a centre are traced in packets as Tracer does, unless lights on
/// Gaussians ask for more; rays that end on a surface are traced once more. Of Scene::trace
/// near_depth, background and sky mean nothing here; view_footprint is of the pixel divided by the
/// root of RenderSettings::samples. Threads: as Context.
class PathTracer {
 public:
  /// Numbers of rays of the last render().
  struct Statistics {
    std::uint64_t camera_rays = 0;     ///< through the pixels of the picture
    std::uint64_t continued_rays = 0;  ///< behind mirrors, glass, transparent and diffuse surfaces
    std::uint64_t shadow_rays = 0;     ///< from surfaces and Gaussians
    std::uint64_t capped_rays = 0;     ///< of all these, stopped because of TraceOptions::max_hits;
                                       ///< where packets trace the camera's, on their whole way
    std::uint64_t ended_by_bounces = 0;  ///< paths that max_bounces ended
  };

  /// What the rays of a camera meet first: pictures of camera.height x camera.width pixels, in rows
  /// from the top left. All are empty when first_hits() was stopped.
  struct FirstHits {
    /// 3 channels, as Tracer::depth(): expected depth and median depth in world units, and the
    /// number of Gaussians before the surface; 0 where nothing is.
    Image depth;
    /// 3 channels, as Tracer::normals(): x, y and z in world axes of the mean normal times alpha.
    Image normals;
    /// 1 channel in [0, 1]: share of the light that does not come from behind everything; 1 where a
    /// surface is.
    Image alpha;
  };

  /// Uploads the scene and builds both trees. Throws UsageError for settings out of range and
  /// Gaussians whose arrays do not fit each other, DataError for meshes with a number that is not
  /// finite or an index out of range and for Gaussians with a number that is not finite,
  /// ResourceError for a scene that is larger than the device.
  PathTracer(Context& context, const Scene& scene);
  ~PathTracer();
  PathTracer(PathTracer&&) noexcept;
  PathTracer& operator=(PathTracer&&) noexcept;

  /// Rays per pixel and the seed of everything random from the next render() on. Pictures of one
  /// sample are sharp, unless they are `of_many` that the caller averages: then their rays too pass
  /// anywhere through the lens and scatter at rough mirrors. Throws UsageError for less than one
  /// sample.
  void set_sampling(int samples, std::uint64_t seed, bool of_many = false);

  /// Replaces the meshes (an animation's next frame); materials and Gaussians stay. Throws
  /// DataError and ResourceError as the constructor.
  void set_meshes(const std::vector<Mesh>& meshes);

  /// The picture of a camera of any model, 4 channels: R, G and B in display values with the
  /// background or environment blended, and as alpha the share of light that did not come from
  /// there. `within` hears the share of the picture that is done, after every sample of a batch of
  /// pixels, and returns false to stop; then the picture is empty. Throws UsageError for a camera
  /// without pixels, with a number that is not finite or with a rotation that is none (Tracer),
  /// ResourceError when its paths would not fit the device beside the scene.
  Image render(const Camera& camera, const std::function<bool(double share)>& within = {});

  /// What the rays through the middles of a picture's pixels meet first: Gaussians, and behind them
  /// the nearest surface, which counts as opaque whatever its material: a mirror has the depth of
  /// its glass, not of what it shows. Its normal is the one that it is shaded with. Whole pictures
  /// for every share (set_share()); `within` and what is thrown as in render(), and ResourceError
  /// where there is no room for some 160 bytes more of each Gaussian.
  FirstHits first_hits(const Camera& camera, const std::function<bool(double share)>& within = {});

  /// The point of the world that is seen first through the middle of a camera's picture: a surface
  /// of any material, or the median depth of the Gaussians before it; nothing where the ray meets
  /// neither. Throws UsageError as render().
  std::optional<glm::dvec3> first_point(const Camera& camera);

  // What follows serves the library itself.

  /// From the next render() on draws part `part`, counted from 0, of `parts` equal ones of the
  /// picture's rows; the pixels of other rows are 0.
  void set_share(std::size_t part, std::size_t parts);
  /// The rows that the last render() drew, from the top: the first, and the one behind the last.
  std::array<int, 2> rows() const;

  /// Numbers of rays of the last render().
  Statistics statistics() const;
  /// The context that it was made with.
  const Context& context() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
