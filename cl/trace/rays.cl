// SPDX-License-Identifier: Apache-2.0
// Arbitrary rays: any origins and directions, each with its own [t_min, t_max].
//   prepare_rays  one record per Gaussian: whitening matrix, mean, opacity, Q.    global: Gaussians
//   trace_rays    one work-item per ray.                                          global: rays
// A ray walks the LBVH near child first with a k-buffer: the BUFFER nearest hits so far, sorted.
// Once it is full, the farthest of them bounds the walk. If hits were dropped, the next pass
// continues behind the last blended (t, index), so the order is exact for any BUFFER >= 1. Cost per
// pass is O(depth + boxes met); passes = ceil(hits / BUFFER).
#include "shared/layout.h"
#include "shared/sh.h"
#include "trace/gaussian.h"

#ifndef BUFFER
#define BUFFER 64
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif
#define RS_STACK 128

// v: rows of M (9), mean (3), opacity, Q (negative: never met), two spare.
__kernel void prepare_rays(const uint count,
                           __global const float* restrict means,
                           __global const float* restrict quaternions,
                           __global const float* restrict scales,
                           __global const float* restrict opacities,
                           const float quantile,
                           __global RsLine* restrict records) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float4 q = vload4(i, quaternions);
  const float norm = sqrt(dot(q, q));
  float R[9], v[16];
  rotation_of(q / norm, R);
  const float opacity = sigmoid(opacities[i]);
  float sum = norm + opacity;
  for (int k = 0; k < 3; ++k) {
    // Thinner than this, 1 / scale^2 leaves float's range.
    const float scale = fmax(activated_scale(scales[3 * i + k]), 1e-12f);
    for (int j = 0; j < 3; ++j) v[3 * k + j] = R[3 * j + k] / scale;
    v[9 + k] = means[3 * i + k];
    sum += scale + fabs(v[9 + k]);
  }
  const float Q = effective_quantile(quantile, opacity);
  v[12] = opacity;
  v[13] = isfinite(sum) && norm > 0.0f && opacity > 0.0f ? Q : -1.0f;
  v[14] = v[15] = 0.0f;
  for (int k = 0; k < 16; ++k) records[i].v[k] = v[k];
}

typedef struct {
  float key, alpha, peak;
  uint index;
} RayHit;

typedef struct {
  float3 o, d, inverse;
  float t_min, t_max;
} RayData;

// Entry of the ray into a box, or INFINITY when it misses [t_min, t_max].
float enter_box(const RayData* ray,
                const __global float* lo,
                const __global float* hi,
                float t_max) {
  const float3 a = ((float3)(lo[0], lo[1], lo[2]) - ray->o) * ray->inverse;
  const float3 b = ((float3)(hi[0], hi[1], hi[2]) - ray->o) * ray->inverse;
  // fmin and fmax drop the NaN of 0 * infinity (an origin on the slab of a zero direction
  // component).
  const float3 near3 = fmin(a, b), far3 = fmax(a, b);
  const float near = fmax(fmax(near3.x, near3.y), fmax(near3.z, ray->t_min));
  // Rounding must not lose a grazing box (Ize 2013).
  const float far = fmin(fmin(far3.x, far3.y), fmin(far3.z * 1.0000004f, t_max)) * 1.0000004f;
  return near <= far && lo[0] <= hi[0] ? near : INFINITY;
}

bool meet(const RayData* ray, __global const float* v, RayHit* hit) {
  const float3 m0 = vload3(0, v), m1 = vload3(1, v), m2 = vload3(2, v);
  const float3 r = ray->o - vload3(3, v);
  const float Q = v[13];
  const float3 o = (float3)(dot(m0, r), dot(m1, r), dot(m2, r));
  const float3 d = (float3)(dot(m0, ray->d), dot(m1, ray->d), dot(m2, ray->d));
  const float dd = dot(d, d);
  const float peak = -dot(o, d) / dd;
  const float3 residual = o + peak * d;
  const float distance2 = dot(residual, residual);
  if (!(distance2 <= Q)) return false;
#if PEAK_ORDER
  const float key = peak;
#else
  const float far_root = peak + sqrt(fmax(Q - distance2, 0.0f) / dd);
  if (!(far_root > 0.0f)) return false;
  const float key = (dot(o, o) - Q) / (dd * far_root);
#endif
  if (!(key >= 0.0f && key >= ray->t_min && key <= ray->t_max)) return false;
  hit->key = key;
  hit->peak = peak;
  hit->alpha = v[12] * native_exp(-0.5f * distance2);
  return true;
}

float3 evaluate_color(__global const float* c, int degree, float3 n) {
  float basis[25];
  rs_sh_basis(degree, n.x, n.y, n.z, basis);
  const int active = (degree + 1) * (degree + 1);
  float3 color = (float3)(0.5f);
  for (int k = 0; k < active; ++k) color += basis[k] * vload3(k, c);
  return fmax(color, (float3)(0.0f));
}

// rays: 8 floats each (origin, t_min, direction, t_max). results: 8 words each (colour, alpha,
// expected depth, median depth, hits, capped).
__kernel void trace_rays(const uint ray_count,
                         const int root,
                         const uint gaussian_count,
                         __global const RsBvhNode* restrict nodes,
                         __global const uint* restrict leaves,
                         __global const RsLine* restrict records,
                         __global const float* restrict sh,
                         const int sh_coefficients,
                         const int active_degree,
                         const int color_from_origin,
                         const float min_transmittance,
                         const int max_hits,
                         const float4 background,
                         __global const float8* restrict rays,
                         __global float8* restrict results) {
  const uint id = get_global_id(0);
  if (id >= ray_count) return;
  RayData ray;
  ray.o = rays[id].s012;
  ray.t_min = fmax(rays[id].s3, 0.0f);
  ray.d = rays[id].s456;
  ray.t_max = rays[id].s7;
  ray.inverse = 1.0f / ray.d;
  const float3 direction = ray.d * rsqrt(fmax(dot(ray.d, ray.d), 1e-38f));

  float T = 1.0f, depth_sum = 0.0f, median = 0.0f;
  float3 color = (float3)(0.0f);
  int hits = 0;
  uint capped = 0;
  float floor_key = -1.0f;
  uint floor_index = 0;
  bool again = gaussian_count > 0;
  RayHit buffer[BUFFER];
  while (again) {
    int size = 0;
    bool dropped = false;
    int stack[RS_STACK];
    int top = 0;
    stack[top++] = root;
    while (top > 0) {
      const int reference = stack[--top];
      const bool full = size == BUFFER;
      const float limit = full ? buffer[BUFFER - 1].key : ray.t_max;
      if (reference >= 0) {
        __global const RsBvhNode* node = nodes + reference;
        const float left = enter_box(&ray, node->left_lo, node->left_hi, ray.t_max);
        const float right = enter_box(&ray, node->right_lo, node->right_hi, ray.t_max);
        const bool take_left = left < INFINITY && left <= limit;
        const bool take_right = right < INFINITY && right <= limit;
        // A box beyond the buffer's last hit may hold hits that this pass has no room for.
        dropped = dropped || (left < INFINITY && !take_left) || (right < INFINITY && !take_right);
        const bool left_first = left <= right;
        if (take_left && !left_first) stack[top++] = node->left;
        if (take_right) stack[top++] = node->right;
        if (take_left && left_first) stack[top++] = node->left;
        continue;
      }
      const uint index = leaves[~reference];
      RayHit hit;
      if (!meet(&ray, records[index].v, &hit)) continue;
      hit.index = index;
      if (hit.key < floor_key || (hit.key == floor_key && index <= floor_index && hits > 0))
        continue;
      if (full) {
        dropped = true;
        const RayHit last = buffer[BUFFER - 1];
        if (hit.key > last.key || (hit.key == last.key && index > last.index)) continue;
        --size;
      }
      int j = size++;
      while (j > 0 && (buffer[j - 1].key > hit.key ||
                       (buffer[j - 1].key == hit.key && buffer[j - 1].index > index))) {
        buffer[j] = buffer[j - 1];
        --j;
      }
      buffer[j] = hit;
    }

    again = dropped && size > 0;
    for (int k = 0; k < size; ++k) {
      if (hits == max_hits) {
        capped = 1;
        again = false;
        break;
      }
      const RayHit hit = buffer[k];
      const float3 to_mean = vload3(3, records[hit.index].v) - ray.o;
      const float3 n =
          color_from_origin ? to_mean * rsqrt(fmax(dot(to_mean, to_mean), 1e-30f)) : direction;
      const float w = T * hit.alpha;
      color += w * evaluate_color(sh + (size_t)hit.index * 3 * sh_coefficients, active_degree, n);
      depth_sum += w * hit.peak;
      const float after = T * (1.0f - hit.alpha);
      if (T >= 0.5f && after < 0.5f) median = hit.peak;
      T = after;
      ++hits;
      floor_key = hit.key;
      floor_index = hit.index;
      if (T < min_transmittance) {
        again = false;
        break;
      }
    }
  }
  color += T * background.xyz;
  const float weight = 1.0f - T;
  results[id] = (float8)(color, weight, weight > 0.0f ? depth_sum / weight : 0.0f, median,
                         as_float((uint)hits), as_float(capped));
}
