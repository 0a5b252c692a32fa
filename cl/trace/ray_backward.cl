// SPDX-License-Identifier: Apache-2.0
// Gradients of a loss over arbitrary rays: walks the rays again (ray_walk.h) and sums per Gaussian
// (ray_sums.h); ray_gradients.cl carries the sums to the parameters.
//
// A batch of hits is taken from its last hit to its first. With P_i = colour_i . g + g_alpha, what
// a hit of ray gradient (g, g_alpha) adds, and S_i, the same for everything behind it as if seen
// with full light (the background at the end of the ray): dL/dalpha_i = T_i (P_i - S_i) and
// S_(i-1) = alpha_i P_i + (1 - alpha_i) S_i. Nothing is divided, so alpha = 1 is no special case.
// Where a ray has more hits than there is room for, what lies behind an early batch is the ray's
// known result minus what is blended so far, divided by the transmittance there (at least
// min_transmittance): that difference costs up to eps / T of relative accuracy. Cost: that of
// trace_rays plus O(1) per hit.
//
// WITH_RAY_GRADIENT 1 also yields the gradients of the rays themselves. Moving the origin moves
// every residual as moving the mean back does; with t_p, the parameter of the point nearest to the
// mean, a change of the direction moves that point by t_p times as much.
//
// Launch: `items` work-items; each takes every items-th chunk of `chunk` rays in the order given,
// or with RS_ONE_RAY one ray.
//   PRIVATE_COPIES 1: work-item i adds to copy i of `sums`: no atomics, the same sum every time
//   EXACT_SUMS 1:     one copy of long integers (exact_sum.h): the same sum in any order
//   otherwise:        one copy of shared floats (float_add.h)
#include "parallel/wave.h"
#include "trace/least_weight.h"
#include "trace/line_sum.h"
#include "trace/ray_color.h"
#include "trace/ray_sums.h"

#ifndef WITH_RAY_GRADIENT
#define WITH_RAY_GRADIENT 0
#endif

// Whether a work-item has one ray, as on GPUs: no loop, whose counters would lie in registers
// during the walk.
#define RS_ONE_RAY (KEPT && !PRIVATE_COPIES)

// Inlines functions that every hit takes, whatever the compiler thinks of their size.
#define RS_SHARE __attribute__((always_inline)) static

// Waves of 16 where their registers are enough.
#if EXACT_SUMS || WITH_RAY_GRADIENT
#define RS_RAY_WAVE
#else
#define RS_RAY_WAVE RS_WAVE_OF_16
#endif

// Lines of sums per Gaussian.
#define RS_RAY_LINES (RS_RAY_SUMS / 16)

// dL/dcolour before it is clamped (shared/color.h).
RS_SHARE float3 passed_to(const float3 color, const float3 gradient) {
  return RS_COLOR_PASSES(color, gradient) && color < RS_MAX_COLOR ? gradient : (float3)(0.0f);
}

typedef struct {
  // Read only.
  __global const float* records;
  LineSums sums;
  float3 screen_x, screen_y, screen_z;  // rows of RsRaySums::screen
  float4 gradient;                      // of the ray's colour and alpha
  float3 background;
  // Final colour . gradient + final alpha * gradient of alpha, less what is blended.
  float behind;
  // What a walk needs.
  float transmittance;
  int room;  // for further hits
  bool stopped;
  float last_key;
  uint next_index;  // one more than its own
#if WITH_RAY_GRADIENT
  float3 by_origin, by_direction;
#endif
} RayState;

// What a hit brings to the line of its Gaussian, but for the colour: `before` is the transmittance
// in front of it, `by_alpha` = dL/dalpha.
RS_SHARE float16 line_sums(const RayData* ray,
                           const float16 record,
                           const float alpha,
                           const float before,
                           const float by_alpha,
                           RayState* state) {
  const float3 x = record.s012, y = record.s345, z = record.s678;  // rows of M = S^-1 R^T
  const float3 offset = ray->o - record.s9ab;
  const float3 o = (float3)(dot(x, offset), dot(y, offset), dot(z, offset));
  const float3 d = (float3)(dot(x, ray->d), dot(y, ray->d), dot(z, ray->d));
  // The residual by cross products: o - d <o, d> / <d, d> loses the small component along the
  // short axis of a thin Gaussian, which counts for its mean and its rotation.
  const float3 v = cross(d, cross(o, d)) / dot(d, d);
  // delta^2 = |v|^2, and v is perpendicular to d'.
  const float g = -0.5f * alpha * by_alpha;
  const float3 by_v = 2.0f * g * v;
  const float3 by_mean = -(by_v.x * x + by_v.y * y + by_v.z * z);
#if WITH_RAY_GRADIENT
  state->by_origin -= by_mean;
  state->by_direction += dot(o, d) / dot(d, d) * by_mean;
#endif
  const float3 on_screen = (float3)(dot(state->screen_x, by_mean), dot(state->screen_y, by_mean),
                                    dot(state->screen_z, by_mean));
  float16 sum = (float16)(0.0f);
  sum.s012 = by_v;
  sum.s345 = g * v.x * v;
  sum.s67 = g * v.y * v.yz;
  sum.s8 = g * v.z * v.z;
  sum.s9 = alpha * by_alpha;
  sum.sa = sqrt(dot(on_screen, on_screen));
  sum.sb = before * alpha - LEAST_WEIGHT;
  return sum;
}

#if SH_DEGREE > 0
// Gradient of what a colour's direction goes to, from that of the colour: n is the unit direction,
// `inverse` one over the length it had.
RS_SHARE float3 direction_gradient_of(const RayScene* scene,
                                      const uint index,
                                      const float3 n,
                                      const float inverse,
                                      const float3 by_color) {
  float along[RS_RAY_FUNCTIONS];
  __global const float* c = scene->sh + (size_t)index * 3 * scene->sh_coefficients;
#if KEPT
#pragma unroll 1
#endif
  for (int k = 0; k < RS_RAY_FUNCTIONS; ++k) along[k] = dot(vload3(k, c), by_color);
  float gradient[3];
  rs_sh_gradient(SH_DEGREE, n.x, n.y, n.z, along, gradient);
  const float3 by_n = (float3)(gradient[0], gradient[1], gradient[2]);
  return (by_n - n * dot(by_n, n)) * inverse;
}

// Adds the gradients of the coefficients of a Gaussian.
RS_SHARE void add_coefficients(const LineSums* sums,
                               const uint index,
                               const float* basis,
                               const float3 by_color) {
  const size_t first = (size_t)index * RS_RAY_SUMS + RS_RAY_SH;
#if KEPT
#pragma unroll 1
#endif
  for (int k = 0; k < RS_RAY_FUNCTIONS; ++k) {
    rs_add_sum(sums, first + k, basis[k] * by_color.x);
    rs_add_sum(sums, first + RS_RAY_FUNCTIONS + k, basis[k] * by_color.y);
    rs_add_sum(sums, first + 2 * RS_RAY_FUNCTIONS + k, basis[k] * by_color.z);
  }
}
#endif

#if KEPT
// Adds what a hit brings, one share after the other: together they would take most of the
// registers. `basis`: of the hit (ray_color.h); `by_color` = dL/dcolour before it is clamped.
RS_INLINE void add_hit(const RayScene* scene,
                       const RayData* ray,
                       const float* basis,
                       const Pending* pending,
                       const int k,
                       const float before,
                       const float by_alpha,
                       const float3 by_color,
                       RayState* state) {
  const uint index = pending_index(scene->tree.blocks, pending, k);
  const size_t line = (size_t)index * RS_RAY_LINES;
  float16 sum = (float16)(0.0f);
#if SH_DEGREE == 0
  (void)basis;
  sum.scde = by_color;
  rs_add_numbers(&state->sums, line, sum, 12, 15);
#else
  add_coefficients(&state->sums, index, basis, by_color);
  if (WITH_RAY_GRADIENT || scene->color_from_origin) {
    const float4 n = color_direction(scene, ray, pending, k);
    const float3 by_way = direction_gradient_of(scene, index, n.xyz, n.w, by_color);
    if (scene->color_from_origin) {
      sum.scde = by_way;
      rs_add_numbers(&state->sums, line, sum, 12, 15);
#if WITH_RAY_GRADIENT
      state->by_origin -= by_way;
    } else {
      state->by_direction += by_way;
#endif
    }
  }
#endif
  const float16 record = *(__global const float16*)(state->records + (size_t)index * 16);
  sum = line_sums(ray, record, pending_alpha(pending, k), before, by_alpha, state);
  rs_add_numbers(&state->sums, line, sum, 0, 12);
}

// Blends the hits from the nearest on: what lies behind each is the known result minus what is
// blended, but for the last of the ray.
RS_INLINE void blend_hits(const RayScene* scene,
                          const RayData* ray,
                          const float* ray_basis,
                          const Pending* pending,
                          const int count,
                          RayState* state) {
  (void)ray_basis;
  const float3 gradient = state->gradient.xyz;
  for (int k = 0; k < count && !state->stopped; ++k) {
    const float alpha = pending_alpha(pending, k);
    float basis[RS_RAY_FUNCTIONS];
    hit_basis(scene, ray, pending, k, basis);
    const float3 color = basis_color(scene, basis, pending, k).xyz;
    const float projected = dot(color, gradient) + state->gradient.w;
    const float before = state->transmittance;
    state->behind -= before * alpha * projected;
    state->transmittance = before * (1.0f - alpha);
    --state->room;
    state->stopped = state->transmittance < scene->min_transmittance || state->room == 0;
    const float behind =
        state->stopped ? dot(state->background, gradient) : state->behind / state->transmittance;
    const float3 by_color = passed_to(color, before * alpha * gradient);
    add_hit(scene, ray, basis, pending, k, before, before * (projected - behind), by_color, state);
  }
}
#else
// Adds what one hit contributes: `by_alpha` = dL/dalpha, `by_color` = dL/dcolour before it is
// clamped.
RS_INLINE void add_hit(const RayScene* scene,
                       const RayData* ray,
                       const float* basis_of_ray,
                       const uint index,
                       const float alpha,
                       const float before,
                       const float by_alpha,
                       const float3 by_color,
                       RayState* state) {
  const float16 record = *(__global const float16*)(state->records + (size_t)index * 16);
  float16 sum = line_sums(ray, record, alpha, before, by_alpha, state);
#if SH_DEGREE == 0
  (void)scene;
  (void)basis_of_ray;
  sum.scde = by_color;
#else
  float own_basis[RS_RAY_FUNCTIONS];
  const float* basis = basis_of_ray;
  if (scene->color_from_origin) {
    const float3 offset = ray->o - record.s9ab;
    const float inverse = rsqrt(fmax(dot(offset, offset), 1e-30f));
    const float3 n = -inverse * offset;
    rs_sh_basis(SH_DEGREE, n.x, n.y, n.z, own_basis);
    basis = own_basis;
    sum.scde = direction_gradient_of(scene, index, n, inverse, by_color);
#if WITH_RAY_GRADIENT
    state->by_origin -= sum.scde;
#endif
  }
#if WITH_RAY_GRADIENT
  if (!scene->color_from_origin) {
    const float inverse = rsqrt(fmax(dot(ray->d, ray->d), 1e-38f));
    state->by_direction += direction_gradient_of(scene, index, inverse * ray->d, inverse, by_color);
  }
#endif
  add_coefficients(&state->sums, index, basis, by_color);
#endif
  rs_add_line(&state->sums, (size_t)index * RS_RAY_LINES, sum);
}

RS_INLINE void blend_hits(const RayScene* scene,
                          const RayData* ray,
                          const float* basis,
                          Pending* pending,
                          int count,
                          RayState* state) {
  // The opacity of evaluated entries is no longer needed: it makes room for the transmittance.
  float* before = pending->opacity;
  int blended = 0;
  while (blended < count && !state->stopped) {
    const int i = pending->order[blended++];
    pending->color[i] = hit_color(scene, ray, basis, pending, blended - 1);
    before[i] = state->transmittance;
    state->transmittance *= 1.0f - pending->alpha[i];
    --state->room;
    state->last_key = pending->key.s[i];
    state->next_index = pending->index[i] + 1;
    state->stopped = state->transmittance < scene->min_transmittance || state->room == 0;
    RS_PREFETCH_READ(state->records + (size_t)pending->index[i] * 16);
    for (int line = 0; line < RS_RAY_LINES; ++line) {
      rs_fetch_line(&state->sums, (size_t)pending->index[i] * RS_RAY_LINES + line);
    }
  }
  const float3 gradient = state->gradient.xyz;
  float behind = dot(state->background, gradient);
  if (!state->stopped) {
    for (int k = 0; k < blended; ++k) {
      const int i = pending->order[k];
      const float projected = dot(pending->color[i].xyz, gradient) + state->gradient.w;
      state->behind -= before[i] * pending->alpha[i] * projected;
    }
    behind = state->behind / state->transmittance;
  }
  for (int k = blended - 1; k >= 0; --k) {
    const int i = pending->order[k];
    const float alpha = pending->alpha[i];
    const float3 color = pending->color[i].xyz;
    const float projected = dot(color, gradient) + state->gradient.w;
    const float3 by_color = passed_to(color, before[i] * alpha * gradient);
    add_hit(scene, ray, basis, pending->index[i], alpha, before[i],
            before[i] * (projected - behind), by_color, state);
    behind = alpha * projected + (1.0f - alpha) * behind;
  }
}
#endif

#include "trace/ray_walk.h"

// Adds what one ray brings; the arguments are those of the kernel.
RS_INLINE void add_ray(const RayScene* scene,
                       __global const RsRay* rays,
                       __global const RsRayResult* results,
                       __global const float4* gradients,
                       const size_t id,
                       RayState* state,
                       __global float8* ray_gradients) {
  const float4 gradient = gradients[id];
  const RayResult result = load_result(results, id);
  const int hits = (int)result.hits;
  if (hits == 0 || !any(gradient != 0.0f)) return;
  const Ray raw = load_ray(rays, id);
  RayData ray = ray_data(raw);
  float basis[RS_RAY_FUNCTIONS];
  basis_along_ray(scene, &ray, basis);
  state->gradient = gradient;
  state->behind = dot(result.color, gradient.xyz) + result.alpha * gradient.w;
  state->transmittance = 1.0f;
  state->room = hits;
  state->stopped = false;
  state->last_key = -1.0f;
  state->next_index = 0;
#if WITH_RAY_GRADIENT
  state->by_origin = state->by_direction = (float3)(0.0f);
#endif
  walk_ray(scene, raw.t_max, basis, &ray, state);
#if WITH_RAY_GRADIENT
  ray_gradients[id] = (float8)(state->by_origin, 0.0f, state->by_direction, 0.0f);
#else
  (void)ray_gradients;
#endif
}

// Gradients of the rays [first, last) in their order. results: what trace_rays gave them;
// gradients: dL/d(R, G, B, alpha) per ray; records: whitening matrix and mean of every Gaussian
// (ray_gradients.cl); sums: as for LineSums; ray_gradients: with WITH_RAY_GRADIENT of every ray the
// gradients of its origin and direction, four floats each, zeros at first.
RS_RAY_WAVE RS_RAY_KERNEL __kernel void ray_backward(const uint first,
                                                     const uint last,
                                                     const uint chunk,
                                                     const uint items,
                                                     RS_TREE_ARGUMENTS,
                                                     __global const float* restrict sh,
                                                     const RsRayWalk walk_argument,
                                                     RS_RAY_ARGUMENTS,
                                                     __global const RsRayResult* restrict results,
                                                     __global const float4* restrict gradients,
                                                     __global const float* restrict records,
                                                     const RsRaySums ray_sums,
                                                     __global float* restrict sums,
                                                     __global float8* restrict ray_gradients) {
  const uint item = get_global_id(0);
  if (item >= items) return;
  const RsRayWalk walk = walk_argument;
  const float3 background = (float3)(walk.background[0], walk.background[1], walk.background[2]);
  RayScene scene = ray_scene(levels, level_begin, nodes, blocks, sh, &walk);
#if KEPT
  __local HitMemory memory;
  scene.memory = &memory;
#endif
  RayState state;
  state.records = records;
  state.background = background;
#if PRIVATE_COPIES
  sums += (size_t)item * ray_sums.gaussians * RS_RAY_SUMS;
#endif
  state.sums.lines = sums;
  state.sums.limit = ray_sums.limit;
  state.screen_x = (float3)(ray_sums.screen[0], ray_sums.screen[1], ray_sums.screen[2]);
  state.screen_y = (float3)(ray_sums.screen[3], ray_sums.screen[4], ray_sums.screen[5]);
  state.screen_z = (float3)(ray_sums.screen[6], ray_sums.screen[7], ray_sums.screen[8]);
#if RS_ONE_RAY
  (void)chunk;
  const uint position = first + item;
  if (position < last) {
    add_ray(&scene, rays, results, gradients, ordered ? ray_order[position] : position, &state,
            ray_gradients);
  }
#else
  for (size_t begin = first + (size_t)item * chunk; begin < last; begin += (size_t)items * chunk) {
    const size_t end = min(begin + chunk, (size_t)last);
    for (size_t position = begin; position < end; ++position) {
      add_ray(&scene, rays, results, gradients, ordered ? ray_order[position] : position, &state,
              ray_gradients);
    }
  }
#endif
}
