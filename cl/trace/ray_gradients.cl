// SPDX-License-Identifier: Apache-2.0
// Before and after ray_backward, one work-item per LANES Gaussians from number `begin` on, any
// local size; end - begin is a multiple of LANES. O(1) per Gaussian.
//   ray_gradient_records  what a hit's gradient needs of a Gaussian, 16 floats: the rows of
//                         M = S^-1 R^T (9), the mean (3), zeros
//   finish_ray_gradients  adds the private copies of the sums (ray_sums.h) in a fixed order, leaves
//                         zeros in the copies behind the first, and carries the sums to the
//                         parameters and to the screen statistics that density control reads
#include "shared/sh.h"
#include "trace/arguments.h"
#include "trace/gaussian.h"
#include "trace/ray_sums.h"

// Floats of SH kept per Gaussian, divided by 3.
#ifndef SH_COEFFICIENTS
#define SH_COEFFICIENTS RS_RAY_FUNCTIONS
#endif

typedef struct {
  fv q[4];  // unit quaternion
  fv q_norm;
  fv scale[3];  // standard deviations, floored as those that rays are traced with
  fv raw_scale[3];
} RayGaussian;

void load_ray_gaussian(const size_t i,
                       __global const float* quaternions,
                       __global const float* scales,
                       RayGaussian* g) {
  load_columns4(quaternions + 4 * i, g->q);
  g->q_norm = sqrt(g->q[0] * g->q[0] + g->q[1] * g->q[1] + g->q[2] * g->q[2] + g->q[3] * g->q[3]);
  for (int j = 0; j < 4; ++j) g->q[j] = g->q[j] / g->q_norm;
  fv longest = 0;
  load_columns3(scales + 3 * i, g->raw_scale);
  for (int k = 0; k < 3; ++k) {
    g->raw_scale[k] = rs_scale_of(g->raw_scale[k]);
    longest = larger(g->raw_scale[k], longest);
  }
  const fv floor_scale = larger(longest * 1e-7f, (fv)(1e-12f));
  for (int k = 0; k < 3; ++k) g->scale[k] = larger(g->raw_scale[k], floor_scale);
}

__kernel void ray_gradient_records(const uint begin,
                                   const uint end,
                                   __global const float* restrict means,
                                   __global const float* restrict quaternions,
                                   __global const float* restrict scales,
                                   __global float* restrict records) {
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
  RayGaussian g;
  load_ray_gaussian(i, quaternions, scales, &g);
  fv R[9], record[16];
  load_columns3(means + 3 * i, record + 9);
  rotation_matrix(g.q[0], g.q[1], g.q[2], g.q[3], R);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) record[3 * k + j] = R[3 * j + k] / g.scale[k];
  }
  for (int k = 12; k < 16; ++k) record[k] = 0;
  store_columns(record, 16, records + 16 * i, 16);
}

// Sums of LANES Gaussians as columns; true in lanes that a ray touched.
iv load_sums(__global float* sums, const size_t copy_floats, const uint copies, fv* v) {
  // LANES Gaussians lie side by side.
  for (uint copy = 1; copy < copies; ++copy) {
    __global float* p = sums + copy * copy_floats;
    for (uint k = 0; k < RS_RAY_SUMS * LANES; k += LANES) {
      const fv part = *(__global const rs_unaligned*)(p + k);
      if (!rs_any_of(part != 0.0f)) continue;
      *(__global rs_unaligned*)(sums + k) += part;
      *(__global rs_unaligned*)(p + k) = (fv)(0.0f);
    }
  }
  load_columns(sums, RS_RAY_SUMS, RS_RAY_SUMS, v);
  fv touched = 0;
  for (int k = 0; k < RS_RAY_SUMS; ++k) touched += fabs(v[k]);
  return touched != 0.0f;
}

// ray_sums.screen: behind the matrix 9..11 the camera's centre, 12 the distance that counts: 0
// straight from there, 1 along the axis 13..15, 2 none.
__kernel void finish_ray_gradients(const uint begin,
                                   const uint end,
                                   const uint copies,
                                   const RsRaySums ray_sums,
                                   __global float* restrict sums,
                                   __global const float* restrict records,
                                   __global const float* restrict quaternions,
                                   __global const float* restrict scales,
                                   __global const float* restrict opacities,
                                   RS_GRADIENT_ARGUMENTS) {
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
  fv v[RS_RAY_SUMS];
  const iv touched =
      load_sums(sums + i * RS_RAY_SUMS, (size_t)ray_sums.gaussians * RS_RAY_SUMS, copies, v);
  if (!rs_any_of(touched)) {
    clear_columns(g_means + 3 * i, 3);
    clear_columns(g_quaternions + 4 * i, 4);
    clear_columns(g_scales + 3 * i, 3);
    clear_columns(g_opacities + i, 1);
    clear_columns(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);
    clear_columns(screen + 4 * i, 4);
    return;
  }

  // Lanes that nothing touched may hold anything; they are cleared last.
  const fv zero = (fv)(0.0f);
  RayGaussian g;
  load_ray_gaussian(i, quaternions, scales, &g);
  fv record[16];
  load_columns(records + 16 * i, 16, 16, record);

  fv mean[3];
  for (int j = 0; j < 3; ++j) {
    mean[j] = -(record[j] * v[0] + record[3 + j] * v[1] + record[6 + j] * v[2]);
  }
  const RsRaySums shares = ray_sums;
  fv length2 = 0, along = 0, distance2 = 0;
  for (int k = 0; k < 3; ++k) {
    const float* row = shares.screen + 3 * k;
    const fv part = row[0] * mean[0] + row[1] * mean[1] + row[2] * mean[2];
    length2 += part * part;
    const fv offset = record[9 + k] - shares.screen[9 + k];
    along += shares.screen[13 + k] * offset;
    distance2 += offset * offset;
  }
  fv distance = 1.0f;
  if (shares.screen[12] == 0.0f) distance = sqrt(distance2);
  if (shares.screen[12] == 1.0f) distance = larger(along, zero);
  const fv seen[4] = {touched ? sqrt(length2) * distance : zero, touched ? v[10] * distance : zero,
                      touched ? (fv)(1.0f) : zero, touched ? v[11] : zero};
  store_columns4(seen, screen + 4 * i);

  fv c[3 * SH_COEFFICIENTS];
#if SH_DEGREE == 0
  for (int j = 0; j < 3; ++j) c[j] = touched ? RS_SH0 * v[12 + j] : zero;
#else
  for (int j = 0; j < 3; ++j) mean[j] += v[12 + j];
  for (int k = 0; k < RS_RAY_FUNCTIONS; ++k) {
    for (int j = 0; j < 3; ++j) {
      c[3 * k + j] = touched ? v[RS_RAY_SH + j * RS_RAY_FUNCTIONS + k] : zero;
    }
  }
#endif
  for (int k = 3 * RS_RAY_FUNCTIONS; k < 3 * SH_COEFFICIENTS; ++k) c[k] = zero;
  store_columns(c, 3 * SH_COEFFICIENTS, g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);
  for (int j = 0; j < 3; ++j) mean[j] = touched ? mean[j] : zero;
  store_columns3(mean[0], mean[1], mean[2], g_means + 3 * i);

  // delta^2 = x^T R S^-2 R^T x. With G = sum of g v v^T: d(log S_k) receives -2 G_kk; a rotation
  // R exp([w]x) receives 2 G_ij (S_j / S_i - S_i / S_j) about the third axis.
  fv turn[3], gs[3];
  for (int k = 0; k < 3; ++k) {
    const fv diagonal = k == 0 ? v[3] : k == 1 ? v[6] : v[8];
    const iv moves = touched & (g.raw_scale[k] >= g.scale[k]);
    const fv value = -2.0f * diagonal * rs_scale_log_derivative(g.scale[k]);
    gs[k] = moves ? value : zero;
    const fv mixed = k == 0 ? v[7] : k == 1 ? v[5] : v[4];
    const fv a = g.scale[(k + 1) % 3], b = g.scale[(k + 2) % 3];
    turn[k] = 2.0f * mixed * (b / a - a / b);
  }
  store_columns3(gs[0], gs[1], gs[2], g_scales + 3 * i);
  // q exp(w / 2) turns R by w.
  fv gq[4];
  gq[0] = -(g.q[1] * turn[0] + g.q[2] * turn[1] + g.q[3] * turn[2]);
  gq[1] = g.q[0] * turn[0] + g.q[2] * turn[2] - g.q[3] * turn[1];
  gq[2] = g.q[0] * turn[1] + g.q[3] * turn[0] - g.q[1] * turn[2];
  gq[3] = g.q[0] * turn[2] + g.q[1] * turn[1] - g.q[2] * turn[0];
  for (int j = 0; j < 4; ++j) gq[j] = touched ? 2.0f * gq[j] / g.q_norm : zero;
  store_columns4(gq, g_quaternions + 4 * i);
  // 1 - opacity has no digits left where a Gaussian is nearly opaque.
  const fv transparency = rs_sigmoid(-load_column(opacities + i, 1));
  store_column(touched ? v[9] * transparency : zero, g_opacities + i, 1);
}
