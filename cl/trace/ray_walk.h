// SPDX-License-Identifier: Apache-2.0
// The walk of one arbitrary ray: finds its hits and hands them over in order, in batches.
//
// A ray walks the tree of bvh/lbvh_node.h near child first and collects hits in no order. Once the
// product of all 1 - alpha collected falls below the least transmittance, the hits found so far are
// enough to stop the ray: they are sorted, and the key at which they do becomes the end of the ray.
// What is found later can only move that end nearer. So opaque scenes cost little more than a
// nearest-hit search and the order stays exact. At the end of the walk the hits are sorted and
// blended. A full list blends what no unvisited box can precede; if that frees too little, the
// farthest hits are dropped, and another walk continues behind the last blended (key, index).
//
// With KEPT, a walk ends with the nearest few hits (ray_nearest.h).
//
// Who includes this defines RayState, with at least the members
//   float transmittance; int room; bool stopped; float last_key; uint next_index;
// (1, the most hits that count, false, -1, 0 before the walk; what follows the last blended hit has
// its key and at least this index, or a greater key; with KEPT the walk tells these two itself;
// with COUNT_WORK also uint nodes and blocks, that were tested) and
//   void blend_hits(scene, ray, basis, pending, count, state),
// which takes the first `count` sorted hits, keeps those members up to date, and ends early, with
// `stopped`, where the ray does.
#ifndef RS_TRACE_RAY_WALK_H
#define RS_TRACE_RAY_WALK_H

#include "trace/ray_color.h"

#if KEPT

#define RS_RAY_KERNEL __attribute__((reqd_work_group_size(GROUP, 1, 1)))

RS_INLINE void walk_ray(
    const RayScene* scene, const float t_max, const float* basis, RayData* ray, RayState* state) {
  const float half_quantile = 0.5f * scene->quantile;
  Pending pending;
  pending.memory = scene->memory;
  pending.column = get_local_id(0);
  park_end(&pending, t_max);
  __global const fv* blocks = scene->tree.blocks;
  uint next_index = 0;
  do {
    float end = parked_end(&pending);
    pending.size = 0;
    pending.remaining = state->transmittance;
    TreeWalk walk;
    walk_begin(&walk, &scene->tree, ray->t_min);
    ray_slabs(ray);  // anew, so that they take no registers while hits are blended
    uint bits, first_block;
    while ((bits = walk_next(&walk, &scene->tree, ray, end, &first_block)) != 0) {
      for (; bits != 0; bits &= bits - 1) {
#if COUNT_WORK
        ++state->blocks;
#endif
        const uint number_of_block = first_block + rs_lowest_bit(bits);
        __global const fv* block = blocks + (size_t)number_of_block * RS_BLOCK_VECTORS;
        BlockMeeting meeting;
#pragma unroll 1
        for (uint lane = 0; lane < LANES; ++lane) {
          if (!ray_meets_block(ray, scene->near, block, lane, &meeting)) continue;
          const float cross2 = meeting.cross2.v, direction2 = meeting.direction2.v;
          const float along = meeting.along.v;
          const float reciprocal = 1.0f / direction2;
          const float peak = -along * reciprocal;
#if PEAK_ORDER
          const float key = peak;
#else
          // The far root times |d'|^2, then the near root by Viete's formula.
          const float root = sqrt(fmax(direction2 - cross2, 0.0f)) - along;
          if (!(root > 0.0f)) continue;
          const float key = (meeting.origin2.v - 1.0f) / root;
#endif
          if (!(key >= ray->t_min && key <= end)) continue;
          const uint index = block_index(block, lane);
          if (key == ray->t_min && index < next_index) continue;
#if ADAPTIVE_RADIUS
          const float exponent = met_half_quantile(&meeting, block, lane);
#else
          const float exponent = half_quantile;
#endif
          const float alpha =
              met_opacity(&meeting, block, lane) * rs_exp((fv)(-exponent * cross2 * reciprocal)).x;
          pending_insert(blocks, &pending, key, alpha, peak, number_of_block * LANES + lane, index);
          const bool ends = pending.remaining < scene->min_transmittance &&
                            pending_end(&pending, scene->min_transmittance, state->transmittance);
          if (ends || pending.size == KEPT) end = pending_key(&pending, pending.size - 1);
        }
      }
    }
#if COUNT_WORK
    state->nodes += walk.nodes;
#endif
    blend_hits(scene, ray, basis, &pending, pending.size, state);
    if (state->stopped || pending.size < KEPT) break;
    // The next walk begins behind the last blended hit.
    ray->t_min = fmax(ray->t_min, pending_key(&pending, KEPT - 1));
    next_index = pending_index(blocks, &pending, KEPT - 1) + 1;
  } while (true);
}

#else

#define RS_RAY_KERNEL

// Slack that keeps a hit from being taken for nearer than an unvisited box by rounding.
#define RS_BOUND_SLACK 0.999999f

// Sorts, and returns the number of leading hits that are enough to end the ray (the one after
// max_hits among them: it tells that the ray was capped), or -1 when they are not. *remaining
// becomes the transmittance behind them.
int sort_to_end(const RayScene* scene, const RayState* state, Pending* pending, float* remaining) {
  pending_sort(pending);
  const int room = state->room;
  float transmittance = state->transmittance;
  for (int k = 0; k < pending->size; ++k) {
    transmittance *= 1.0f - pending->alpha[pending->order[k]];
    if (transmittance < scene->min_transmittance || k == room) {
      *remaining = transmittance;
      return k + 1;
    }
  }
  *remaining = transmittance;
  return -1;
}

// The hits of a ray with keys up to t_max, from ray->t_min on, which moves with every further walk.
RS_INLINE void walk_ray(
    const RayScene* scene, const float t_max, const float* basis, RayData* ray, RayState* state) {
  const float half_quantile = 0.5f * scene->quantile;
  Pending pending;
  PendingRange range = {ray->t_min, t_max, 0, 0xffffffffu, false};
  bool again = scene->tree.levels > 0;
  while (again) {
    again = false;
    pending.size = pending.evaluated = 0;
    float remaining = state->transmittance;  // behind all evaluated hits
    float hopeful = remaining;               // no more than is left behind all hits
    int sorted = 0;                          // size after the last sort
    TreeWalk walk;
    walk_begin(&walk, &scene->tree, ray->t_min);
    uint bits, first_block;
    while (!state->stopped &&
           (bits = walk_next(&walk, &scene->tree, ray, range.end, &first_block)) != 0) {
      for (; bits != 0; bits &= bits - 1) {
#if COUNT_WORK
        ++state->blocks;
#endif
        const uint number_of_block = first_block + rs_lowest_bit(bits);
        __global const fv* block = scene->tree.blocks + (size_t)number_of_block * RS_BLOCK_VECTORS;
        BlockMeeting meeting;
        for (uint hits = ray_meets_block(ray, scene->near, block, 0, &meeting); hits != 0;
             hits &= hits - 1) {
          const uint lane = rs_lowest_bit(hits);
          pending_append(&pending, &meeting, block, number_of_block * LANES + lane, lane);
          prefetch_color(scene, pending.index[pending.size - 1]);
          hopeful *= 1.0f - met_opacity(&meeting, block, lane);
        }
        const int room = state->room;
        if (!(hopeful < scene->min_transmittance) && pending.size <= min(room, RAY_HITS - LANES))
          continue;
        remaining = hopeful = pending_evaluate(&pending, &range, half_quantile, remaining);
        const bool full = pending.size > RAY_HITS - LANES;
        const bool enough = remaining < scene->min_transmittance || pending.size > room;
        if (!full && !(enough && 4 * (pending.size - sorted) > pending.size)) continue;
        const int end = sort_to_end(scene, state, &pending, &remaining);
        int count = pending.size;
        if (end > 0) {
          const float key = pending.key.s[pending.order[end - 1]];
          if (key < range.end) range.end_index = 0xffffffffu;
          range.end = key;
          // Equal keys stay together.
          for (count = end; count < pending.size; ++count) {
            if (pending.key.s[pending.order[count]] > key) break;
          }
        }
        if (count <= RAY_HITS - LANES) {
          if (end > 0) pending_cut(&pending, range.end);
        } else {
          const float bound = RS_BOUND_SLACK * walk_bound(&walk);
          int ready = 0;
          while (ready < count && pending.key.s[pending.order[ready]] < bound) ++ready;
          blend_hits(scene, ray, basis, &pending, ready, state);
          if (state->stopped) break;
          int kept = count - ready;
          if (kept > RAY_HITS / 2) {
            kept = RAY_HITS / 2;
            const int last = pending.order[ready + kept - 1];
            range.end = pending.key.s[last];
            range.end_index = pending.index[last];
            range.ties = again = true;
          }
          remaining = state->transmittance * pending_keep(&pending, ready, kept);
        }
        hopeful = remaining;
        sorted = pending.size;
      }
    }
#if COUNT_WORK
    state->nodes += walk.nodes;
#endif
    if (state->stopped) break;
    pending_evaluate(&pending, &range, half_quantile, remaining);
    pending_sort(&pending);
    blend_hits(scene, ray, basis, &pending, pending.size, state);
    if (state->stopped) break;
    // The next walk begins behind the last blended hit.
    ray->t_min = range.begin = fmax(ray->t_min, state->last_key);
    range.begin_index = state->next_index;
    range.end = t_max;
    range.end_index = 0xffffffffu;
  }
}

#endif

#endif
