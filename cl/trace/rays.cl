// SPDX-License-Identifier: Apache-2.0
// Arbitrary rays: any origins and directions, each with its own [t_min, t_max].
// Launch of trace_rays: one work-item per `rays_per_item` neighbours (1 on GPUs; on CPUs more, in
// groups of one, so that all rays share one piece of private memory). Cost per ray: nodes and
// blocks met / PACKET lanes, plus hits^2 / PACKET for the order.
//
// A ray walks the tree of ray_block.h near child first and collects hits in no order. Once the
// product of all 1 - alpha collected falls below the least transmittance, the hits found so far are
// enough to stop the ray: they are sorted, and the key at which they do becomes the end of the ray.
// What is found later can only move that end nearer. So opaque scenes cost little more than a
// nearest-hit search and the order stays exact. At the end of the walk the hits are sorted and
// blended. A full list blends what no unvisited box can precede; if that frees too little, the
// farthest hits are dropped, and another walk continues behind the last blended (key, index).
#include "primitives/prefetch.h"
#include "shared/layout.h"
#include "shared/sh.h"
#include "trace/ray_block.h"
#include "trace/ray_pending.h"

// A child of every level stays behind: PACKET - 1 per level, and 2^31 Gaussians have 15 levels of 4
// or 7 of 16.
#define RS_STACK 128
// Slack that keeps a hit from being taken for nearer than an unvisited box by rounding.
#define RS_BOUND_SLACK 0.999999f

typedef struct {
  __global const fv* blocks;
  __global const float* sh;
  int sh_coefficients;
  int active_degree;
  int color_from_origin;
  float min_transmittance;
  int max_hits;
} RayScene;

typedef struct {
  float4 color;  // the fourth lane is zero
  float transmittance, depth_sum, median;
  int hits;
  bool capped, stopped;
  float last_key;  // of the last blended hit
  uint last_index;
} RayState;

float4 hit_color(const RayScene* scene,
                 const RayData* ray,
                 const float* ray_basis,
                 const Pending* pending,
                 int entry) {
  const int degree = scene->active_degree;
  if (degree == 0) return pending->color[entry];
  const uint slot = pending->slot[entry];
  float own_basis[25];
  const float* basis = ray_basis;
  if (scene->color_from_origin) {
    __global const float* mean =
        (__global const float*)(scene->blocks + slot / PACKET * RS_BLOCK_VECTORS) + 6 * PACKET +
        slot % PACKET;
    const float3 v = (float3)(mean[0], mean[PACKET], mean[2 * PACKET]) - ray->o;
    const float3 n = v * rsqrt(fmax(dot(v, v), 1e-30f));
    rs_sh_basis(degree, n.x, n.y, n.z, own_basis);
    basis = own_basis;
  }
  __global const float* c = scene->sh + (size_t)pending->index[entry] * 3 * scene->sh_coefficients;
  const int active = (degree + 1) * (degree + 1);
  float3 even = (float3)(0.5f), odd = (float3)(0.0f);
  even += basis[0] * vload3(0, c);
  for (int k = 1; k < active; k += 2) odd += basis[k] * vload3(k, c);
  for (int k = 2; k < active; k += 2) even += basis[k] * vload3(k, c);
  return (float4)(fmax(even + odd, (float3)(0.0f)), 0.0f);
}

// Blending reads a Gaussian's coefficients long after its hit is found: time to fetch them.
void prefetch_color(const RayScene* scene, uint index) {
  if (scene->active_degree == 0) return;
  __global const float* c = scene->sh + (size_t)index * 3 * scene->sh_coefficients;
  const int active = 3 * (scene->active_degree + 1) * (scene->active_degree + 1);
  for (int k = 0; k < active; k += 16) RS_PREFETCH_READ(c + k);
  (void)c;
}

// Blends the first `count` sorted hits; ends early, with `stopped`, where the ray does.
void blend_hits(const RayScene* scene,
                const RayData* ray,
                const float* ray_basis,
                const Pending* pending,
                int count,
                RayState* state) {
  for (int k = 0; k < count; ++k) {
    if (state->hits == scene->max_hits) {
      state->capped = state->stopped = true;
      return;
    }
    const int i = pending->order[k];
    const float alpha = pending->alpha[i], peak = pending->peak[i];
    const float before = state->transmittance;
    const float weight = before * alpha;
    state->color += weight * hit_color(scene, ray, ray_basis, pending, i);
    state->depth_sum += weight * peak;
    state->transmittance = before * (1.0f - alpha);
    if (before >= 0.5f && state->transmittance < 0.5f) state->median = peak;
    ++state->hits;
    state->last_key = pending->key.s[i];
    state->last_index = pending->index[i];
    if (state->transmittance < scene->min_transmittance) {
      state->stopped = true;
      return;
    }
  }
}

// Sorts, and returns the number of leading hits that are enough to end the ray (the one after
// max_hits among them: it tells that the ray was capped), or -1 when they are not. *remaining
// becomes the transmittance behind them.
int sort_to_end(const RayScene* scene, const RayState* state, Pending* pending, float* remaining) {
  pending_sort(pending);
  const int room = scene->max_hits - state->hits;
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

// rays: 8 floats each (origin, t_min, direction, t_max). results: 8 words each (colour, alpha,
// expected depth, median depth, hits, capped). level_begin[l]: first node of level l, from 1;
// ray_order: which ray a work-item traces, read when `ordered`.
__kernel void trace_rays(const uint ray_count,
                         const uint rays_per_item,
                         const int levels,
                         __global const uint* restrict level_begin,
                         __global const fv* restrict nodes,
                         __global const fv* restrict blocks,
                         __global const float* restrict sh,
                         const int sh_coefficients,
                         const int active_degree,
                         const int color_from_origin,
                         const float quantile,
                         const float min_transmittance,
                         const int max_hits,
                         const float4 background,
                         __global const float8* restrict rays,
                         const int ordered,
                         __global const uint* restrict ray_order,
                         __global float8* restrict results) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  for (uint position = first; position < last; ++position) {
    const size_t id = ordered ? ray_order[position] : position;
    const float8 raw = rays[id];
    RayData ray = ray_data(raw);
    const RayScene scene = {
        blocks, sh, sh_coefficients, active_degree, color_from_origin, min_transmittance, max_hits};
    float basis[25];
    if (active_degree > 0 && !color_from_origin) {
      const float3 n = ray.d * rsqrt(fmax(dot(ray.d, ray.d), 1e-38f));
      rs_sh_basis(active_degree, n.x, n.y, n.z, basis);
    }

    RayState state = {(float4)(0.0f), 1.0f, 0.0f, 0.0f, 0, false, false, -1.0f, 0};
    const float half_quantile = 0.5f * quantile;
    Pending pending;
    PendingRange range = {ray.t_min, raw.s7, 0, 0xffffffffu, false};
    bool again = levels > 0;
    while (again) {
      again = false;
      pending.size = pending.evaluated = 0;
      float remaining = state.transmittance;  // behind all evaluated hits
      float hopeful = remaining;              // no more than is left behind all hits
      int sorted = 0;                         // size after the last sort
      float stack_entry[RS_STACK];
      uint stack_node[RS_STACK];  // level in the lowest four bits
      int top = 1;
      stack_entry[0] = ray.t_min;
      stack_node[0] = (uint)levels;
      while (top > 0 && !state.stopped) {
        const float node_entry = stack_entry[--top];
        if (!(node_entry <= range.end)) continue;
        const uint level = stack_node[top] & 15;
        const uint number = stack_node[top] >> 4;
        RayLanes entry;
        uint bits =
            ray_meets_boxes(&ray, nodes + (size_t)(level_begin[level] + number) * RS_NODE_VECTORS,
                            range.end, &entry.v);
        if (level > 1) {
          const int bottom = top;
          for (; bits != 0; bits &= bits - 1) {
            const uint lane = rs_lowest_bit(bits);
            const float t = entry.s[lane];
            int j = top++;
            for (; j > bottom && stack_entry[j - 1] < t; --j) {
              stack_entry[j] = stack_entry[j - 1];
              stack_node[j] = stack_node[j - 1];
            }
            stack_entry[j] = t;
            stack_node[j] = (number * PACKET + lane) << 4 | (level - 1);
          }
          continue;
        }
        for (; bits != 0; bits &= bits - 1) {
          const uint number_of_block = number * PACKET + rs_lowest_bit(bits);
          __global const fv* block = blocks + (size_t)number_of_block * RS_BLOCK_VECTORS;
          BlockMeeting meeting;
          for (uint hits = ray_meets_block(&ray, block, &meeting); hits != 0; hits &= hits - 1) {
            const uint lane = rs_lowest_bit(hits);
            pending_append(&pending, &meeting, block, number_of_block * PACKET + lane, lane);
            prefetch_color(&scene, pending.index[pending.size - 1]);
            hopeful *= 1.0f - block_opacity(block, lane);
          }
          const int room = max_hits - state.hits;
          if (!(hopeful < min_transmittance) && pending.size <= min(room, PENDING - PACKET))
            continue;
          remaining = hopeful = pending_evaluate(&pending, &range, half_quantile, remaining);
          const bool full = pending.size > PENDING - PACKET;
          const bool enough = remaining < min_transmittance || pending.size > room;
          if (!full && !(enough && 4 * (pending.size - sorted) > pending.size)) continue;
          const int end = sort_to_end(&scene, &state, &pending, &remaining);
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
          if (count <= PENDING - PACKET) {
            if (end > 0) pending_cut(&pending, range.end);
          } else {
            // Boxes on the stack and in this node begin behind `bound`.
            float bound = node_entry;
            for (int k = 0; k < top; ++k) bound = fmin(bound, stack_entry[k]);
            bound *= RS_BOUND_SLACK;
            int ready = 0;
            while (ready < count && pending.key.s[pending.order[ready]] < bound) ++ready;
            blend_hits(&scene, &ray, basis, &pending, ready, &state);
            if (state.stopped) break;
            int kept = count - ready;
            if (kept > PENDING / 2) {
              kept = PENDING / 2;
              const int last = pending.order[ready + kept - 1];
              range.end = pending.key.s[last];
              range.end_index = pending.index[last];
              range.ties = again = true;
            }
            remaining = state.transmittance * pending_keep(&pending, ready, kept);
          }
          hopeful = remaining;
          sorted = pending.size;
        }
      }
      if (state.stopped) break;
      pending_evaluate(&pending, &range, half_quantile, remaining);
      pending_sort(&pending);
      blend_hits(&scene, &ray, basis, &pending, pending.size, &state);
      if (state.stopped) break;
      // The next walk begins behind the last blended hit.
      ray.t_min = range.begin = fmax(ray.t_min, state.last_key);
      range.begin_index = state.last_index + 1;
      range.end = raw.s7;
      range.end_index = 0xffffffffu;
    }
    const float3 color = state.color.xyz + state.transmittance * background.xyz;
    const float weight = 1.0f - state.transmittance;
    results[id] =
        (float8)(color, weight, weight > 0.0f ? state.depth_sum / weight : 0.0f, state.median,
                 as_float((uint)state.hits), as_float((uint)(state.capped ? 1 : 0)));
  }
}
