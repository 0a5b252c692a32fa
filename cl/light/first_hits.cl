// SPDX-License-Identifier: Apache-2.0
// What rays meet first: Gaussians, and behind them the nearest surface, whatever it is made of.
//
// end_at_surfaces: rays end where they meet a triangle. Gaussians that carry their normals as
//   colours (normal_gaussians.cl) are traced then, over black.
// add_surfaces: color becomes the sum of w n; alpha and the depths (along `axis`, depth_cosine)
//   take the surface in as an opaque hit behind all Gaussians. What begins before it and is
//   strongest behind it has its depth at most.
// Launch: one work-item per ray.
#include "bvh/ray.h"
#include "light/shading.h"

__kernel void end_at_surfaces(const uint count,
                              __global const RsSurfaceHit* restrict hits,
                              __global RsRay* restrict rays) {
  const uint i = get_global_id(0);
  if (i >= count || hits[i].triangle < 0) return;
  Ray ray = load_ray(rays, i);
  ray.t_max = hits[i].t;
  store_ray(ray, rays, i);
}

// vertices: as for surface_point().
__kernel void add_surfaces(const uint count,
                           const float4 axis,
                           __global const RsSurfaceHit* restrict hits,
                           __global const float* restrict vertices,
                           __global const RsRay* restrict rays,
                           __global RsRayResult* restrict results) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsSurfaceHit hit = hits[i];
  const Ray ray = load_ray(rays, i);
  RayResult result = load_result(results, i);
  result.color = 2.0f * result.color - result.alpha;
  if (hit.triangle >= 0) {
    const float rest = 1.0f - result.alpha;
    result.color += rest * surface_point(vertices, &hit, ray.direction).shading;
    const float cloud = fmin(result.expected_depth, hit.t);
    result.expected_depth = result.alpha * cloud + rest * hit.t;
    result.median_depth = result.median_depth > 0.0f ? fmin(result.median_depth, hit.t) : hit.t;
    result.alpha = 1.0f;
  }
  const float cosine = depth_cosine(axis, ray.direction);
  result.expected_depth *= cosine;
  result.median_depth *= cosine;
  store_result(result, results, i);
}
