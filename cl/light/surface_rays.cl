// SPDX-License-Identifier: Apache-2.0
// Rays against triangles. nearest_surface: the first triangle along each ray; of several at the
// same t the one with the lowest index. light_through: the share of light that passes all triangles
// between the ends of a ray. Launch: one work-item per `rays_per_item` neighbours (1 on GPUs; on
// CPUs more, in groups of one, so that all rays share one piece of private memory). Cost per ray:
// nodes and blocks met / PACKET lanes.
#include "light/triangle_block.h"

// Less light than this counts as none.
#define RS_DARK 1e-4f

typedef struct {
  float entry[RS_NODE_STACK];
  uint node[RS_NODE_STACK];  // level in the lowest four bits
  int top;
} WalkStack;

// The nearest node left whose box begins before t_end. False when there is none.
bool next_node(WalkStack* stack, float t_end, uint* node) {
  while (stack->top > 0) {
    --stack->top;
    if (!(stack->entry[stack->top] <= t_end)) continue;
    *node = stack->node[stack->top];
    return true;
  }
  return false;
}

// Puts the children `bits` of a node on the stack, the nearest on top.
void push_children(WalkStack* stack, uint bits, const RayLanes* entry, uint node) {
  const int bottom = stack->top;
  for (; bits != 0; bits &= bits - 1) {
    const uint lane = rs_lowest_bit(bits);
    const float t = entry->s[lane];
    int j = stack->top++;
    for (; j > bottom && stack->entry[j - 1] < t; --j) {
      stack->entry[j] = stack->entry[j - 1];
      stack->node[j] = stack->node[j - 1];
    }
    stack->entry[j] = t;
    stack->node[j] = ((node >> 4) * PACKET + lane) << 4 | ((node & 15) - 1);
  }
}

// rays: origin, t_min, direction, t_max. skip: triangle that ray i does not meet, read with a
// stride of `skip_stride` words; 0 = none is skipped.
#define RS_SURFACE_RAY_ARGUMENTS                                               \
  const uint ray_count, const uint rays_per_item, RS_TREE_ARGUMENTS,           \
      __global const float8 *restrict rays, __global const int *restrict skip, \
      const uint skip_stride

// Hits lie in (t_min, t_max].
__kernel void nearest_surface(RS_SURFACE_RAY_ARGUMENTS, __global RsSurfaceHit* restrict hits) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  for (uint id = first; id < last; ++id) {
    const float8 raw = rays[id];
    const RayData ray = ray_data(raw);
    const ShearedRay sheared = sheared_ray(&ray);
    const int skipped = skip_stride > 0 ? skip[(size_t)id * skip_stride] : -1;
    RsSurfaceHit best;
    best.t = raw.s7;
    best.u = best.v = 0.0f;
    best.triangle = -1;
    WalkStack stack;
    stack.top = levels > 0 ? 1 : 0;
    stack.entry[0] = ray.t_min;
    stack.node[0] = (uint)levels;
    uint node;
    while (next_node(&stack, best.t, &node)) {
      const uint level = node & 15;
      RayLanes entry;
      uint bits = ray_meets_boxes(
          &ray, nodes + (size_t)(level_begin[level] + (node >> 4)) * RS_NODE_VECTORS, best.t,
          &entry.v);
      if (level > 1) {
        push_children(&stack, bits, &entry, node);
        continue;
      }
      for (; bits != 0; bits &= bits - 1) {
        __global const fv* block =
            blocks + (size_t)((node >> 4) * PACKET + rs_lowest_bit(bits)) * RS_TRIANGLE_VECTORS;
        TriangleMeeting meeting;
        for (uint met = ray_meets_triangles(&sheared, block, ray.t_min, best.t, &meeting); met != 0;
             met &= met - 1) {
          const uint lane = rs_lowest_bit(met);
          const float t = meeting.t.s[lane];
          const int triangle = triangle_index(block, lane);
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
    hits[id] = best;
  }
}

// passes[i] = product of 1 - shadow over the triangles that ray i crosses; rays with t_max < t_min
// give 1. shadow: one value per triangle.
__kernel void light_through(RS_SURFACE_RAY_ARGUMENTS,
                            __global const float* restrict shadow,
                            __global float* restrict passes) {
  const uint first = (uint)get_global_id(0) * rays_per_item;
  const uint last = min(first + rays_per_item, ray_count);
  for (uint id = first; id < last; ++id) {
    const float8 raw = rays[id];
    const RayData ray = ray_data(raw);
    const ShearedRay sheared = sheared_ray(&ray);
    const int skipped = skip_stride > 0 ? skip[(size_t)id * skip_stride] : -1;
    float light = 1.0f;
    WalkStack stack;
    stack.top = levels > 0 ? 1 : 0;
    stack.entry[0] = ray.t_min;
    stack.node[0] = (uint)levels;
    uint node;
    while (light > RS_DARK && next_node(&stack, raw.s7, &node)) {
      const uint level = node & 15;
      RayLanes entry;
      uint bits = ray_meets_boxes(
          &ray, nodes + (size_t)(level_begin[level] + (node >> 4)) * RS_NODE_VECTORS, raw.s7,
          &entry.v);
      if (level > 1) {
        push_children(&stack, bits, &entry, node);
        continue;
      }
      for (; bits != 0; bits &= bits - 1) {
        __global const fv* block =
            blocks + (size_t)((node >> 4) * PACKET + rs_lowest_bit(bits)) * RS_TRIANGLE_VECTORS;
        TriangleMeeting meeting;
        for (uint met = ray_meets_triangles(&sheared, block, ray.t_min, raw.s7, &meeting); met != 0;
             met &= met - 1) {
          const int triangle = triangle_index(block, rs_lowest_bit(met));
          if (triangle != skipped) light *= 1.0f - shadow[triangle];
        }
      }
    }
    passes[id] = light > RS_DARK ? light : 0.0f;
  }
}
