// SPDX-License-Identifier: Apache-2.0
// Rays against triangles. nearest_surface: the first triangle along each ray; of several at the
// same t the one with the lowest index. light_through: the share of light that passes all triangles
// between the ends of a ray. Launch: one work-item per `rays_per_item` neighbours (1 on GPUs; on
// CPUs more, in groups of one, so that all rays share one piece of private memory). Cost per ray:
// nodes and blocks met / LANES lanes. Work-groups of GROUP, where that is defined.
#include "light/triangle_block.h"
#include "parallel/wave.h"

// Less light than this counts as none.
#define RS_DARK 1e-4f

#ifdef GROUP
#define RS_SURFACE_KERNEL RS_WAVE_OF_16 __attribute__((reqd_work_group_size(GROUP, 1, 1)))
#else
#define RS_SURFACE_KERNEL
#endif

// skip: triangle that ray i does not meet, read with a
// stride of `skip_stride` words; 0 = none is skipped.
#define RS_SURFACE_RAY_ARGUMENTS                                              \
  const uint ray_count, const uint rays_per_item, RS_TREE_ARGUMENTS,          \
      __global const RsRay *restrict rays, __global const int *restrict skip, \
      const uint skip_stride

// Hits lie in (t_min, t_max].
RS_SURFACE_KERNEL __kernel void nearest_surface(RS_SURFACE_RAY_ARGUMENTS,
                                                __global RsSurfaceHit* restrict hits) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  const RayTree tree = {levels, level_begin, nodes, blocks};
  for (uint id = first; id < last; ++id) {
    const Ray raw = load_ray(rays, id);
    const RayData ray = ray_data(raw);
    const ShearedRay sheared = sheared_ray(&ray);
    const int skipped = skip_stride > 0 ? skip[(size_t)id * skip_stride] : -1;
    RsSurfaceHit best;
    best.t = raw.t_max;
    best.u = best.v = 0.0f;
    best.triangle = -1;
    TreeWalk walk;
    walk_begin(&walk, &tree, ray.t_min);
    uint bits, first_block;
    while ((bits = walk_next(&walk, &tree, &ray, best.t, &first_block)) != 0) {
      for (; bits != 0; bits &= bits - 1) {
        __global const fv* block =
            blocks + (size_t)(first_block + rs_lowest_bit(bits)) * RS_TRIANGLE_VECTORS;
        TriangleMeeting meeting;
#pragma unroll 1
        for (uint from = 0; from < LANES; from += RS_BLOCK_LANES) {
          uint met = ray_meets_triangles(&sheared, block, from, ray.t_min, best.t, &meeting);
          for (; met != 0; met &= met - 1) {
            const uint lane = rs_lowest_bit(met);
            const float t = meeting.t.s[lane];
            const int triangle = triangle_index(block, from + lane);
            if (triangle == skipped) continue;
            if (t > best.t || (t == best.t && best.triangle >= 0 && triangle > best.triangle))
              continue;
            best.t = t;
            best.u = meeting.u.s[lane];
            best.v = meeting.v.s[lane];
            best.triangle = triangle;
          }
        }
      }
    }
    hits[id] = best;
  }
}

// passes[i] = product of 1 - shadow over the triangles that ray i crosses; rays with t_max < t_min
// give 1. shadow: one value per triangle. A surface is crossed once where its triangles share an
// edge or a corner; but nothing passes there between opaque ones that only nearly do.
RS_SURFACE_KERNEL __kernel void light_through(RS_SURFACE_RAY_ARGUMENTS,
                                              __global const float* restrict shadow,
                                              __global float* restrict passes) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  const RayTree tree = {levels, level_begin, nodes, blocks};
  for (uint id = first; id < last; ++id) {
    const Ray raw = load_ray(rays, id);
    const RayData ray = ray_data(raw);
    const ShearedRay sheared = sheared_ray(&ray);
    const int skipped = skip_stride > 0 ? skip[(size_t)id * skip_stride] : -1;
    float light = 1.0f;
    TreeWalk walk;
    walk_begin(&walk, &tree, ray.t_min);
    uint bits, first_block;
    while (light > RS_DARK &&
           (bits = walk_next(&walk, &tree, &ray, raw.t_max, &first_block)) != 0) {
      for (; bits != 0; bits &= bits - 1) {
        __global const fv* block =
            blocks + (size_t)(first_block + rs_lowest_bit(bits)) * RS_TRIANGLE_VECTORS;
        TriangleMeeting meeting;
#pragma unroll 1
        for (uint from = 0; from < LANES; from += RS_BLOCK_LANES) {
          uint met = ray_meets_triangles(&sheared, block, from, ray.t_min, raw.t_max, &meeting);
          for (; met != 0; met &= met - 1) {
            const uint lane = rs_lowest_bit(met);
            const int triangle = triangle_index(block, from + lane);
            if (triangle == skipped) continue;
            const bool counts = (meeting.own >> lane & 1) != 0 || shadow[triangle] >= 1.0f;
            light *= counts ? 1.0f - shadow[triangle] : 1.0f;
          }
        }
      }
    }
    passes[id] = light > RS_DARK ? light : 0.0f;
  }
}
