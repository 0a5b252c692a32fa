// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/scene.hpp"
#include "reference/environment.hpp"
#include "reference/tracer.hpp"
#include "reference/triangles.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats::reference {

/// A scene with what all its rays share.
struct LightScene {
  explicit LightScene(const Scene& scene);

  Scene scene;
  Parameters parameters;
  std::vector<PreparedGaussian> prepared;
  std::vector<Triangle> triangles;
  EnvironmentLight environment;
  TraceOptions options;  ///< without background
  double bias = 0.0;
};

/// A stretch of a path between two surfaces, for tests of where light goes.
struct LightSegment {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0};
  double t_start = 0.0;
  double t_end = 0.0;               ///< infinity: left the scene
  glm::dvec3 throughput{0.0};       ///< at its start, times the probability of a chosen branch
  int surfaces = 0;                 ///< met before it
  int triangle = -1;                ///< that ended it
  std::vector<std::size_t> bodies;  ///< materials of the glass it is in, innermost last
};

struct LightPath {
  glm::dvec3 color{0.0};
  double alpha = 0.0;
  /// Smallest distance, relative to its own scale, of any decision from going the other way: as
  /// RayTrace::margin, and edges and order of triangles, the limit of total reflection, the side of
  /// a normal, the end by throughput. Decisions that cannot change the colour by 1e-4 do not count.
  double margin = 1.0;
  /// Throughput at glass surfaces where the device chooses one branch by chance; here both count
  /// with their probabilities.
  double chance = 0.0;
  std::vector<LightSegment> segments;  ///< in depth-first order, reflection first
};

/// The light along one ray after docs/light.md, by recursion over brute force. `direction` is
/// normalised first. Mirrors are smooth whatever their roughness, sphere lights are integrated over
/// 256 points of their disc instead of sampled. `from_center`: the ray leaves a camera's centre;
/// `cone`: of the ray.
/// Throws UsageError for indirect light.
LightPath trace_light(const LightScene& scene,
                      const glm::dvec3& origin,
                      const glm::dvec3& direction,
                      bool from_center = false,
                      const Cone& cone = {});
LightPath trace_light(const Scene& scene, const glm::dvec3& origin, const glm::dvec3& direction);

/// The share of a light's colour that reaches a point past triangles and Gaussians (V before
/// `strength`); those up to `t_after` on the way and the triangle `skip` do not count, nor do
/// Gaussians within the reach of `leading` along the way.
double visibility(const LightScene& scene,
                  const Light& light,
                  const glm::dvec3& point,
                  double t_after,
                  int skip,
                  bool triangles,
                  bool gaussians,
                  double& margin,
                  const PreparedGaussian* leading = nullptr);

struct LightRender {
  int width = 0;
  int height = 0;
  std::vector<double> image;  ///< planar R, G, B, A; 4 x height x width
  std::vector<double> margin;
  std::vector<double> chance;

  std::size_t pixels() const { return pixel_count(width, height); }
};

/// One ray through the centre of every pixel. Throws UsageError for cameras other than pinholes.
LightRender render_light(const Scene& scene, const Camera& camera);

}  // namespace raysplats::reference
