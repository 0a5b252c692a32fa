// SPDX-License-Identifier: Apache-2.0
// Adaptive density control after 3D Gaussian Splatting (Kerbl et al. 2023, section 5): gradient
// statistics, the gather that builds the new set of Gaussians from the old one, and the opacity
// reset. Launch: one work-item per Gaussian (of the new set for gather_gaussians), any group size,
// ids checked. Complexity: O(N) memory traffic; no work-item reads what another one writes.

#include "shared/activation.h"
#include "shared/layout.h"
#include "shared/train_layout.h"

#ifndef SH_COEFFICIENTS
#define SH_COEFFICIENTS 16
#endif

// Halves of a split along the longest axis (as "Improved-GS", with the constants of LichtFeld
// Studio's IGS+, arXiv 2603.08661): offset in standard deviations, what is left of the longest and
// of the other axes, and of the opacity.
#ifndef HALF_OFFSET
#define HALF_OFFSET 0.5f
#define HALF_LONGEST 0.5f
#define HALF_OTHERS 0.85f
#define HALF_OPACITY 0.6f
#endif

// statistics: 3 N, {sum of the signal, number of views that saw the Gaussian, by how much their
// rays blend more than the least weight}; signal 0 = screen, 1 = absolute. screen: 4 N, of one view
// or a sum over views; the third number tells how many saw it. A signal that is not finite is left
// out; a guard word that is not 0 turns all off.
kernel void accumulate_screen(uint count,
                              uint signal,
                              global const float* screen,
                              global const uint* guard,
                              global float* statistics) {
  const uint i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float views = screen[4 * i + 2];
  if (views > 0.0f && isfinite(screen[4 * i + signal])) {
    statistics[3 * i] += screen[4 * i + signal];
    statistics[3 * i + 1] += views;
    statistics[3 * i + 2] += screen[4 * i + 3];
  }
}

// statistics[i] = {how far the mean has moved since `before`, in units of 1 / inverse_unit; 1; 0}.
// A guard word that is not 0 turns it off.
kernel void measure_step(uint count,
                         float inverse_unit,
                         global const float* before,
                         global const float* means,
                         global const uint* guard,
                         global float* statistics) {
  const uint i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float way = inverse_unit * distance(vload3(i, means), vload3(i, before));
  if (isfinite(way)) vstore3((float3)(way, 1.0f, 0.0f), i, statistics);
}

// Four independent 32-bit words from four (Jarzynski and Olano 2020, "Hash Functions for GPU
// Rendering", pcg4d).
uint4 hash4(uint4 v) {
  v = v * 1664525u + 1013904223u;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  v ^= v >> 16;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return v;
}

// Three standard normal numbers (Box and Muller 1958) that depend on the key, the parent and the
// child alone.
float3 child_offset(uint key_low, uint key_high, uint parent, uint child) {
  const uint4 bits = hash4((uint4)(parent, child, key_low, key_high));
  // (0, 1]: the logarithm stays finite.
  const float4 u = (convert_float4(bits >> 8) + 1.0f) * 5.9604644775390625e-8f;
  const float2 radius = sqrt(-2.0f * log(u.xy));
  const float2 angle = 6.283185307179586f * u.zw;
  return (float3)(radius.x * cos(angle.x), radius.x * sin(angle.x), radius.y * cos(angle.y));
}

float3 rotate(float4 q, float3 v) {
  // q = (real, i, j, k), normalised here as everywhere it is used.
  q *= rsqrt(fmax(dot(q, q), 1e-30f));
  const float3 t = 2.0f * cross(q.yzw, v);
  return v + q.x * t + cross(q.yzw, t);
}

float3 scales_of(const float3 p) {
  return (float3)(rs_scale_of(p.x), rs_scale_of(p.y), rs_scale_of(p.z));
}

float3 parameters_of_scales(const float3 s) {
  return (float3)(rs_parameter_of_scale(s.x), rs_parameter_of_scale(s.y),
                  rs_parameter_of_scale(s.z));
}

// The parameter of an opacity of HALF_OPACITY times that of `logit`.
float half_opacity(float logit) {
  const float opacity = HALF_OPACITY / (1.0f + exp(-logit));
  return log(opacity / (1.0f - opacity));
}

// Gaussian i of the new set comes from source[i] of the old one in the role role[i]. The two
// children of a split are drawn from the parent's own distribution and are smaller by split_factor;
// the two halves lie side by side along the parent's longest axis. Parts are drawn from the
// parent's distribution, because equal ones in one place would have equal gradients and stay
// together.
kernel void gather_gaussians(uint count,
                             uint key_low,
                             uint key_high,
                             float split_factor,
                             global const uint* source,
                             global const uint* role,
                             global const float* means,
                             global const float* quaternions,
                             global const float* scales,
                             global const float* opacities,
                             global const float* sh,
                             global float* new_means,
                             global float* new_quaternions,
                             global float* new_scales,
                             global float* new_opacities,
                             global float* new_sh) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const size_t from = source[i];
  const size_t to = i;
  float3 mean = vload3(from, means);
  const float4 quaternion = vload4(from, quaternions);
  float3 scale = vload3(from, scales);
  float opacity = opacities[from];
  if (role[i] == RS_ROLE_PART) {
    const float3 s = scales_of(scale);
    mean += rotate(quaternion, s * child_offset(key_low, key_high, (uint)from, i));
  } else if (role[i] >= RS_ROLE_FIRST_HALF) {
    float3 s = scales_of(scale);
    const float longest = fmax(s.x, fmax(s.y, s.z));
    const float3 axis = s.x == longest   ? (float3)(1.0f, 0.0f, 0.0f)
                        : s.y == longest ? (float3)(0.0f, 1.0f, 0.0f)
                                         : (float3)(0.0f, 0.0f, 1.0f);
    const float side = role[i] == RS_ROLE_FIRST_HALF ? HALF_OFFSET : -HALF_OFFSET;
    mean += rotate(quaternion, side * longest * axis);
    s *= HALF_OTHERS + (HALF_LONGEST - HALF_OTHERS) * axis;
    scale = parameters_of_scales(s);
    opacity = half_opacity(opacity);
  } else if (role[i] >= RS_ROLE_FIRST_CHILD) {
    const float3 s = scales_of(scale);
    mean += rotate(quaternion,
                   s * child_offset(key_low, key_high, (uint)from, role[i] - RS_ROLE_FIRST_CHILD));
    scale = parameters_of_scales(s / split_factor);
  }
  vstore3(mean, to, new_means);
  vstore4(quaternion, to, new_quaternions);
  vstore3(scale, to, new_scales);
  new_opacities[to] = opacity;
  for (uint k = 0; k < 3 * SH_COEFFICIENTS; ++k) {
    new_sh[to * 3 * SH_COEFFICIENTS + k] = sh[from * 3 * SH_COEFFICIENTS + k];
  }
}

// Lowers every opacity parameter to at most `limit` (a logit).
kernel void limit_opacity(uint count, float limit, global float* opacities) {
  const uint i = get_global_id(0);
  if (i < count) opacities[i] = fmin(opacities[i], limit);
}

// Lowers every opacity by `amount`, down to `lowest` at most.
kernel void fade_opacity(uint count, float amount, float lowest, global float* opacities) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float opacity = rs_sigmoid(opacities[i]);
  const float faded = fmax(opacity - amount, fmin(opacity, lowest));
  if (faded < opacity) opacities[i] = log(faded / (1.0f - faded));
}
