// SPDX-License-Identifier: Apache-2.0
// Sort keys under which rays that cross the same part of the scene are neighbours: five bits of
// each coordinate of the points where the ray enters and leaves the scene's box, interleaved (a
// Morton curve through the space of segments). Work-items that run together or one after another
// then read the same nodes and blocks. Launch: at least `count` work-items, O(1) each.
#include "trace/ray_block.h"

// Bits 0..4 of x to bits 0, 6, 12, 18, 24.
uint spread_by_six(uint x) {
  return (x & 1) | (x & 2) << 5 | (x & 4) << 10 | (x & 8) << 15 | (x & 16) << 20;
}

uint point_key(float3 p, float3 lo, float3 scale) {
  const float3 cell = clamp((p - lo) * scale, 0.0f, 31.0f);
  return spread_by_six((uint)cell.x) << 2 | spread_by_six((uint)cell.y) << 1 |
         spread_by_six((uint)cell.z);
}

// keys[i] for ray i, indices[i] = i. The scene's box is lane 0 of node `scene`. Rays that miss it
// come last.
__kernel void ray_keys(__global const RsRay* restrict rays,
                       const uint count,
                       __global const float* restrict nodes,
                       const uint scene,
                       __global uint* restrict keys,
                       __global uint* restrict indices) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const Ray raw = load_ray(rays, i);
  const RayData ray = ray_data(raw);
  const RsBox box = load_child(nodes, scene, 0);
  const float3 lo = box.lo.xyz, hi = box.hi.xyz;
  const float3 a = (lo - ray.o) * ray.inverse, b = (hi - ray.o) * ray.inverse;
  const float3 near = fmin(a, b), far = fmax(a, b);
  const float enter = fmax(fmax(near.x, near.y), fmax(near.z, ray.t_min));
  const float leave = fmin(fmin(far.x, far.y), fmin(far.z, raw.t_max));
  const float3 scale = 32.0f / fmax(hi - lo, 1e-30f);
  uint key = 1u << 30;
  if (enter <= leave) {
    key = point_key(ray.o + enter * ray.d, lo, scale) << 3 |
          point_key(ray.o + leave * ray.d, lo, scale);
  }
  keys[i] = key;
  indices[i] = i;
}
