// SPDX-License-Identifier: Apache-2.0
// Arbitrary rays: any origins and directions, each with its own [t_min, t_max].
// Launch of trace_rays: one work-item per `rays_per_item` neighbours (1 on GPUs; on CPUs more, in
// groups of one, so that all rays share one piece of private memory). Cost per ray: nodes and
// blocks met / LANES lanes, plus hits^2 / LANES for the order (ray_walk.h).
#include "parallel/wave.h"
#include "trace/ray_color.h"

#ifndef LEADING
#define LEADING 0
#endif

typedef struct {
  float4 color;  // the fourth lane is zero
  float transmittance, depth_sum, median;
  int room;  // for further hits
  bool capped, stopped;
  float last_key;   // of the last blended hit
  uint next_index;  // one more than its own
#if LEADING
  float most;    // the largest weight so far, in front of the median
  uint leading;  // the Gaussian of the median depth, or else of the largest weight
#endif
#if COUNT_WORK
  uint nodes, blocks;
#endif
} RayState;

RS_INLINE void blend_hits(const RayScene* scene,
                          const RayData* ray,
                          const float* ray_basis,
                          const Pending* pending,
                          int count,
                          RayState* state) {
  for (int k = 0; k < count; ++k) {
    if (state->room == 0) {
      state->capped = state->stopped = true;
      return;
    }
    const float alpha = pending_alpha(pending, k), peak = pending_peak(pending, k);
    const uint index = pending_index(scene->tree.blocks, pending, k);
    const float before = state->transmittance;
    const float weight = before * alpha;
    state->color += weight * hit_color(scene, ray, ray_basis, pending, k);
    state->depth_sum += weight * peak;
    state->transmittance = before * (1.0f - alpha);
    const bool middle = before >= 0.5f && state->transmittance < 0.5f;
    if (middle) state->median = peak;
#if LEADING
    if (middle || (before >= 0.5f && weight > state->most)) {
      state->most = weight;
      state->leading = index;
    }
#endif
    --state->room;
    state->last_key = pending_key(pending, k);
    state->next_index = index + 1;
    if (state->transmittance < scene->min_transmittance) {
      state->stopped = true;
      return;
    }
  }
}

#include "trace/ray_walk.h"

// Of every ray: the flag that is read where the launch's color_from_origin is 2, and its cone, read
// where the launch has_cones. Cones take more registers than a wave of 16 has.
#if CONES
#define RS_RAY_KINDS \
  __global const uint *restrict from_origin, __global const RsCone *restrict cones
#define RS_RAY_WAVE
#else
#define RS_RAY_KINDS __global const uint* restrict from_origin
#define RS_RAY_WAVE RS_WAVE_OF_16
#endif

// With LEADING the hits of a result are the Gaussian that leads them: of the median depth, or the
// one that shows most where there is none.
RS_RAY_WAVE RS_RAY_KERNEL __kernel void trace_rays(const uint ray_count,
                                                   const uint rays_per_item,
                                                   RS_TREE_ARGUMENTS,
                                                   __global const float* restrict sh,
                                                   const RsRayWalk walk_argument,
                                                   RS_RAY_ARGUMENTS,
                                                   RS_RAY_KINDS,
                                                   __global RsRayResult* restrict results) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  const RsRayWalk walk = walk_argument;
  const float3 background = (float3)(walk.background[0], walk.background[1], walk.background[2]);
  RayScene scene = ray_scene(levels, level_begin, nodes, blocks, sh, &walk);
#if KEPT
  __local HitMemory memory;
  scene.memory = &memory;
#endif
  for (uint position = first; position < last; ++position) {
    const size_t id = ordered ? ray_order[position] : position;
    const Ray raw = load_ray(rays, id);
    RayData ray = ray_data(raw);
#if CONES
    if (walk.has_cones) widen_ray(cones[id], walk.quantile, &ray);
#endif
    if (walk.color_from_origin == 2) scene.color_from_origin = (int)from_origin[id];
    float basis[25];
    basis_along_ray(&scene, &ray, basis);
    RayState state = {(float4)(0.0f), 1.0f, 0.0f, 0.0f, walk.max_hits, false, false, -1.0f, 0};
#if LEADING
    state.most = 0.0f;
    state.leading = 0;
#endif
#if COUNT_WORK
    state.nodes = state.blocks = 0;
#endif
    walk_ray(&scene, raw.t_max, basis, &ray, &state);
    const float3 color = state.color.xyz + state.transmittance * background;
    const float weight = 1.0f - state.transmittance;
#if COUNT_WORK
    // In place of the depths, for the model of speed: nodes and blocks that the walk tested.
    const float depth = (float)state.nodes;
    state.median = (float)state.blocks;
#else
    const float depth = weight > 0.0f ? state.depth_sum / weight : 0.0f;
#endif
#if LEADING
    const uint count = state.leading;
#else
    const uint count = (uint)(walk.max_hits - state.room);
#endif
    const RayResult result = {color, weight, depth, state.median, count, state.capped ? 1 : 0};
    store_result(result, results, id);
  }
}
