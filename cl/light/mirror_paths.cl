// SPDX-License-Identifier: Apache-2.0
// Rays of a picture that mirrors turn, forward and backward. Level b holds the rays after b
// mirrors; `starts`, an exclusive sum, tells which ray of level b + 1 continues ray i: it is
// starts[i] where starts[i + 1] differs.
// A ray sees V = C + (1 - A) B and covers alpha = 1 - (1 - A) (1 - beta), with C and A of the
// Gaussians in front of its end and B, beta of what is behind: tint times the continued ray's,
// black and 1 behind a mirror that is the last one allowed, the background and 0 where there is
// none. Launch: one work-item per ray or pixel, any group size, O(1) each.
#include "bvh/ray.h"
#include "light/shading.h"
#include "parallel/counter.h"

// Whether the mirror at `hit` is left again.
bool goes_on(__global const uint* starts, uint i) { return starts[i + 1] != starts[i]; }

// Ends rays at the mirrors they meet; starts[i] = 1 where one goes on behind it.
__kernel void end_at_mirrors(const uint count,
                             const int last_level,
                             __global const RsSurfaceHit* restrict hits,
                             __global RsRay* restrict rays,
                             __global uint* restrict starts) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const bool met = hits[i].triangle >= 0;
  if (met) rays[i].t_max = hits[i].t;
  starts[i] = met && !last_level;
}

// vertices: as for surface_point(). With has_cones the cones go on behind the mirror as if it were
// not there.
__kernel void reflect_rays(const uint count,
                           const int has_cones,
                           __global const RsSurfaceHit* restrict hits,
                           __global const uint* restrict starts,
                           __global const float* restrict vertices,
                           __global const RsRay* restrict rays,
                           __global const RsCone* restrict cones,
                           __global RsRay* restrict next_rays,
                           __global RsPath* restrict next_paths,
                           __global RsCone* restrict next_cones) {
  const uint i = get_global_id(0);
  if (i >= count || !goes_on(starts, i)) return;
  const RsSurfaceHit hit = hits[i];
  const float3 d = load_ray(rays, i).direction;
  const SurfacePoint point = surface_point(vertices, &hit, d);
  float3 direction = reflected(d, point.shading);
  if (dot(direction, point.normal) <= 0.0f) direction = reflected(d, point.normal);
  const float3 start = start_off_surface(point.position, point.normal, direction, point.offset);
  const uint to = starts[i];
  const Ray next = {start, direction, 0.0f, FLT_MAX};
  store_ray(next, next_rays, to);
  next_paths[to].skip = hit.triangle;
  if (has_cones) next_cones[to] = cone_behind(cones[i], hit.t);
}

typedef struct {
  float3 color, tint;
  float alpha;
  bool continued;
} Behind;

Behind behind_of(const uint i,
                 const int mirrors,
                 const float4 background,
                 __global const RsSurfaceHit* hits,
                 __global const uint* starts,
                 __global const uint* materials_of,
                 __global const RsMaterial* materials,
                 __global const float4* next_seen) {
  Behind out = {background.xyz, (float3)(0.0f), 0.0f, false};
  if (!mirrors || hits[i].triangle < 0) return out;
  out.color = (float3)(0.0f);
  out.alpha = 1.0f;
  if (!goes_on(starts, i)) return out;
  const float4 seen = next_seen[starts[i]];
  out.tint = vload3(0, materials[materials_of[hits[i].triangle]].color);
  out.color = out.tint * seen.xyz;
  out.alpha = seen.w;
  out.continued = true;
  return out;
}

// results: C and A, and whether the ray stopped at the cap on hits, which `capped` counts. seen: V,
// alpha.
__kernel void gather_light(const uint count,
                           const int mirrors,
                           const float4 background,
                           __global const RsSurfaceHit* restrict hits,
                           __global const uint* restrict starts,
                           __global const uint* restrict materials_of,
                           __global const RsMaterial* restrict materials,
                           __global const float4* restrict next_seen,
                           __global const RsRayResult* restrict results,
                           __global float4* restrict seen,
                           volatile __global uint* restrict capped) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const Behind behind =
      behind_of(i, mirrors, background, hits, starts, materials_of, materials, next_seen);
  const RayResult result = load_result(results, i);
  const float passed = 1.0f - result.alpha;
  seen[i] = (float4)(result.color + passed * behind.color, 1.0f - passed * (1.0f - behind.alpha));
  if (result.capped != 0) rs_count(capped, 1);
}

// gradients: of V and alpha; they become those of C and A. next_gradients: of the continued rays.
__kernel void spread_gradients(const uint count,
                               const int mirrors,
                               const float4 background,
                               __global const RsSurfaceHit* restrict hits,
                               __global const uint* restrict starts,
                               __global const uint* restrict materials_of,
                               __global const RsMaterial* restrict materials,
                               __global const float4* restrict next_seen,
                               __global const RsRayResult* restrict results,
                               __global float4* restrict gradients,
                               __global float4* restrict next_gradients) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const Behind behind =
      behind_of(i, mirrors, background, hits, starts, materials_of, materials, next_seen);
  const float4 g = gradients[i];
  const float passed = 1.0f - results[i].alpha;
  gradients[i].w = g.w * (1.0f - behind.alpha) - dot(g.xyz, behind.color);
  if (behind.continued) {
    next_gradients[starts[i]] = passed * (float4)(g.xyz * behind.tint, g.w);
  }
}

// What the rays of the pixels from `first` on saw, as planes of a picture of `pixels`.
__kernel void store_picture(const uint count,
                            const uint first,
                            const uint pixels,
                            __global const float4* restrict seen,
                            __global float* restrict image) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float4 value = seen[i];
  image[first + i] = value.x;
  image[(size_t)pixels + first + i] = value.y;
  image[2 * (size_t)pixels + first + i] = value.z;
  image[3 * (size_t)pixels + first + i] = value.w;
}

// Depths and hits of the same rays as planes, depths counted along `axis` (depth_cosine).
__kernel void store_depth(const uint count,
                          const uint first,
                          const uint pixels,
                          const float4 axis,
                          __global const RsRay* restrict rays,
                          __global const RsRayResult* restrict results,
                          __global float* restrict depth) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float cosine = depth_cosine(axis, load_ray(rays, i).direction);
  const RayResult result = load_result(results, i);
  depth[first + i] = cosine * result.expected_depth;
  depth[(size_t)pixels + first + i] = cosine * result.median_depth;
  depth[2 * (size_t)pixels + first + i] = (float)result.hits;
}

// The other way round.
__kernel void load_gradients(const uint count,
                             const uint first,
                             const uint pixels,
                             __global const float* restrict image_gradient,
                             __global float4* restrict gradients) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  __global const float* from = image_gradient + first + i;
  gradients[i] =
      (float4)(from[0], from[(size_t)pixels], from[2 * (size_t)pixels], from[3 * (size_t)pixels]);
}
