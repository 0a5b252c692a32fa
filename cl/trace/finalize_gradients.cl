// SPDX-License-Identifier: Apache-2.0
// finalize_gradients: carries the gradients of Gaussians' lines on to their parameters, once per
// Gaussian and view after all rays are summed: mean, unnormalised quaternion, scale parameter under
// either activation, opacity logit, SH coefficients (with the direction's dependence on the mean),
// and the screen statistics that density control reads. Sums the private copies of the line
// gradients in a fixed order, leaves the sum in the first copy and zeros in the others. One
// work-item per VECTOR Gaussians from number `begin` on, any local size; end - begin is a multiple
// of VECTOR. With POSE, per-Gaussian contributions to the camera's gradient are written too (6
// floats each: centre in world axes, left rotation vector in camera axes).
#include "trace/arguments.h"
#include "trace/view.h"

#ifndef POSE
#define POSE 0
#endif
// Adds to the gradients of the parameters, for the second and further faces of a lens.
#ifndef ACCUMULATE
#define ACCUMULATE 0
#endif
// The screen gradient counts the angle in which the mean is seen (LENS 2 of packet.h).
#ifndef ANGULAR
#define ANGULAR 0
#endif

typedef struct {
  gv m[3];
  gv axis[9];
  gv w[3];
} ViewGradient;

void projective_gradient(const ViewGaussian* g, const gv* v, ViewGradient* out) {
  const gv mx = g->m[0], my = g->m[1], mz = g->m[2];
  const gv iz = 1.0f / mz;
  const gv x0 = mx * iz, y0 = my * iz;
  gv ex = 0, ey = 0, d0 = 0;
  gv P[3], gP[3];
  for (int k = 0; k < 3; ++k) {
    P[k] = g->w[(k + 1) % 3] * g->w[(k + 2) % 3];
    out->m[k] = 0;
  }
  for (int k = 0; k < 3; ++k) {
    const gv rx = g->axis[3 * k], ry = g->axis[3 * k + 1], rz = g->axis[3 * k + 2];
    const gv w = g->w[k];
    const gv A = ry * mz - rz * my;
    const gv B = rz * mx - rx * mz;
    const gv gA = P[k] * P[k] * (2.0f * v[3] * A + v[4] * B);
    const gv gB = P[k] * P[k] * (2.0f * v[5] * B + v[4] * A);
    gP[k] = 2.0f * P[k] * (v[3] * A * A + v[4] * A * B + v[5] * B * B);
    const gv along = rx * mx + ry * my + rz * mz;
    const gv q = along * w;
    d0 += q * q;
    ex += q * rx * w;
    ey += q * ry * w;
    const gv ge = v[7] * rx + v[8] * ry;
    const gv gq = 2.0f * v[6] * q * iz * iz + ge * w * iz;
    out->w[k] =
        ge * q * iz + 2.0f * w * (v[9] * rx * rx + v[10] * rx * ry + v[11] * ry * ry) + gq * along;
    out->axis[3 * k] =
        v[7] * q * w * iz + w * w * (2.0f * v[9] * rx + v[10] * ry) + gq * w * mx - gB * mz;
    out->axis[3 * k + 1] =
        v[8] * q * w * iz + w * w * (2.0f * v[11] * ry + v[10] * rx) + gq * w * my + gA * mz;
    out->axis[3 * k + 2] = gq * w * mz - gA * my + gB * mx;
    out->m[0] += gq * w * rx + gB * rz;
    out->m[1] += gq * w * ry - gA * rz;
    out->m[2] += gq * w * rz + gA * ry - gB * rx;
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out->w[i] += gP[k] * g->w[j];
    out->w[j] += gP[k] * g->w[i];
  }
  out->m[0] += v[0] * iz;
  out->m[1] += v[1] * iz;
  out->m[2] -= (v[0] * x0 + v[1] * y0) * iz + 2.0f * v[6] * d0 * iz * iz * iz +
               (v[7] * ex + v[8] * ey) * iz * iz;
}

// In place of the projective gradient in the lanes where `general` holds.
void general_gradient(const ViewGaussian* g, const gv* v, const gi general, ViewGradient* out) {
  gv m[3] = {0, 0, 0};
  for (int k = 0; k < 3; ++k) {
    const gv w = g->w[k];
    const gv go = v[9 + k];
    gv along = 0, gw = 0;
    for (int j = 0; j < 3; ++j) {
      const gv r = g->axis[3 * k + j];
      along += r * g->m[j];
      gw += v[3 * k + j] * r;
      out->axis[3 * k + j] = general ? (v[3 * k + j] - go * g->m[j]) * w : out->axis[3 * k + j];
      m[j] -= go * w * r;
    }
    out->w[k] = general ? gw - go * along : out->w[k];
  }
  for (int j = 0; j < 3; ++j) out->m[j] = general ? m[j] : out->m[j];
}

// Sums the copies of the line gradients of VECTOR Gaussians into columns; true in lanes that a ray
// touched.
gi sum_copies(__global float* gradients, const size_t copy_floats, const uint copies, gv* v) {
  gv touched = 0;
  for (uint c = 0; c < 16; c += VECTOR) {
    gv rows[VECTOR];
#pragma unroll
    for (uint i = 0; i < VECTOR; ++i) rows[i] = *(__global const gv*)(gradients + 16 * i + c);
    gv any_lane = 0;  // of single copies: their sum may cancel
    for (uint copy = 1; copy < copies; ++copy) {
      __global const float* p = gradients + copy * copy_floats + c;
#pragma unroll
      for (uint i = 0; i < VECTOR; ++i) {
        const gv part = *(__global const gv*)(p + 16 * i);
        rows[i] += part;
        any_lane += fabs(part);
      }
    }
    if (RS_ANY_GAUSSIAN(any_lane != 0.0f)) {
#pragma unroll
      for (uint i = 0; i < VECTOR; ++i) *(__global gv*)(gradients + 16 * i + c) = rows[i];
      for (uint copy = 1; copy < copies; ++copy) {
        __global float* p = gradients + copy * copy_floats + c;
#pragma unroll
        for (uint i = 0; i < VECTOR; ++i) *(__global gv*)(p + 16 * i) = (gv)(0.0f);
      }
    }
    transpose(rows, v + c);
  }
  for (int k = 0; k < 16; ++k) touched += fabs(v[k]);
  return touched != 0.0f;
}

#if ACCUMULATE
// The values of VECTOR Gaussians as they lie in memory, and adding them to what has been written.
void load_rows(__global const float* p, const uint stride, gv* rows) {
  for (uint k = 0; k < stride; ++k) rows[k] = *(__global const gv_unaligned*)(p + k * VECTOR);
}
void add_rows(__global float* p, const uint stride, const gv* rows) {
  for (uint k = 0; k < stride; ++k) *(__global gv_unaligned*)(p + k * VECTOR) += rows[k];
}
#endif

__kernel void finalize_gradients(const uint begin,
                                 const uint end,
                                 const RsFinalize finalize,
                                 const RsCamera camera_argument,
                                 __global float* restrict line_gradients,
                                 __global const RsViewBounds* restrict bounds,
                                 __global const RsLine* restrict lines,
                                 RS_GAUSSIAN_ARGUMENTS,
                                 RS_GRADIENT_ARGUMENTS,
                                 __global float* restrict pose) {
#if !POSE
  (void)pose;
#endif
#if SH_DEGREE == 0
  (void)sh;
#endif
  const size_t i = begin + get_global_id(0) * (size_t)VECTOR;
  if (i >= end) return;
  const RsCamera camera = camera_argument;
  gv box[8];
  load_records8((__global const float*)(bounds + i), box);
  const gi kind = RS_AS_INT(box[6]);
  gv v[16];
  gi touched = kind != RS_LINE_HIDDEN;
  if (RS_ANY_GAUSSIAN(touched)) {
    touched =
        sum_copies(line_gradients + 16 * i, (size_t)finalize.gaussians * 16, finalize.copies, v);
  }
  if (!RS_ANY_GAUSSIAN(touched)) {
#if ACCUMULATE
    return;
#endif
    clear_columns(g_means + 3 * i, 3);
    clear_columns(g_quaternions + 4 * i, 4);
    clear_columns(g_scales + 3 * i, 3);
    clear_columns(g_opacities + i, 1);
    clear_columns(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);
    clear_columns(screen + 3 * i, 3);
#if POSE
    clear_columns(pose + 6 * i, 6);
#endif
    return;
  }

  // Lanes that nothing touched may hold anything; they are cleared last.
  const gv zero = (gv)(0.0f);
  ViewGaussian g;
  load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  ViewGradient view;
  projective_gradient(&g, v, &view);
  const gi projective = kind == RS_LINE_PROJECTIVE;
  const gi general = kind == RS_LINE_GENERAL;
  if (RS_ANY_GAUSSIAN(touched & general)) general_gradient(&g, v, general, &view);
#if ANGULAR
  const gv x0 = g.m[0] / g.m[2], y0 = g.m[1] / g.m[2];
  const gv across = x0 * v[0] + y0 * v[1];
  gv slope = finalize.screen_x *
             sqrt((1.0f + x0 * x0 + y0 * y0) * (v[0] * v[0] + v[1] * v[1] + across * across));
#else
  const float screen_x = finalize.screen_x, screen_y = finalize.screen_y;
  gv slope = sqrt(v[0] * v[0] * screen_x * screen_x + v[1] * v[1] * screen_y * screen_y);
#endif
  slope = (touched & projective) ? slope : zero;
  gv absolute = (touched & projective) ? v[2] : zero;
  gv met = touched ? (gv)(1.0f) : zero;
#if ACCUMULATE
  gv before[3], old_means[3], old_quaternions[4], old_scales[3], old_opacities[1];
  gv old_sh[3 * SH_COEFFICIENTS];
  load_columns3(screen + 3 * i, before);
  load_rows(g_means + 3 * i, 3, old_means);
  load_rows(g_quaternions + 4 * i, 4, old_quaternions);
  load_rows(g_scales + 3 * i, 3, old_scales);
  load_rows(g_opacities + i, 1, old_opacities);
  load_rows(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, old_sh);
  slope += before[0];
  absolute += before[1];
  met = larger(met, before[2]);
#endif
  store_columns3(slope, absolute, met, screen + 3 * i);

  const float* V = camera.rotation;
  gv mean[3], gR[9];
  for (int j = 0; j < 3; ++j) {
    mean[j] = V[j] * view.m[0] + V[3 + j] * view.m[1] + V[6 + j] * view.m[2];
    for (int k = 0; k < 3; ++k) {
      gR[3 * j + k] = V[j] * view.axis[3 * k] + V[3 + j] * view.axis[3 * k + 1] +
                      V[6 + j] * view.axis[3 * k + 2];
    }
  }

  // Colour: max(0, .) passes nothing where it clamps. Direction n = (m - c) / |m - c|.
  const gv* d = g.offset;
  const gv inverse = 1.0f / sqrt(larger(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], (gv)(1e-30f)));
  gv n[3];
  for (int j = 0; j < 3; ++j) n[j] = d[j] * inverse;
  gv line[16], colour[3];
  load_columns(lines[i].v, 16, 16, line);
  for (int j = 0; j < 3; ++j) colour[j] = (touched & (line[13 + j] > 0.0f)) ? v[13 + j] : zero;
  gv basis[RS_SH_FUNCTIONS];
  rs_sh_basis(SH_DEGREE, n[0], n[1], n[2], basis);
  gv c[3 * SH_COEFFICIENTS];
#if SH_DEGREE > 0
  load_columns(sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, 3 * RS_SH_FUNCTIONS, c);
  gv along[RS_SH_FUNCTIONS];
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) {
    along[k] = c[3 * k] * colour[0] + c[3 * k + 1] * colour[1] + c[3 * k + 2] * colour[2];
  }
  gv gn[3];
  rs_sh_gradient(SH_DEGREE, n[0], n[1], n[2], along, gn);
  const gv radial = gn[0] * n[0] + gn[1] * n[1] + gn[2] * n[2];
  for (int j = 0; j < 3; ++j) mean[j] += (gn[j] - radial * n[j]) * inverse;
#endif
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) {
    for (int j = 0; j < 3; ++j) c[3 * k + j] = touched ? basis[k] * colour[j] : zero;
  }
  for (int k = 3 * RS_SH_FUNCTIONS; k < 3 * SH_COEFFICIENTS; ++k) c[k] = zero;
  store_columns(c, 3 * SH_COEFFICIENTS, g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);
  for (int j = 0; j < 3; ++j) mean[j] = touched ? mean[j] : zero;
  store_columns3(mean[0], mean[1], mean[2], g_means + 3 * i);
#if POSE
  gv rotation[3];
  rotation[0] = g.m[1] * view.m[2] - g.m[2] * view.m[1];
  rotation[1] = g.m[2] * view.m[0] - g.m[0] * view.m[2];
  rotation[2] = g.m[0] * view.m[1] - g.m[1] * view.m[0];
  for (int k = 0; k < 3; ++k) {
    const gv* r = g.axis + 3 * k;
    const gv* gr = view.axis + 3 * k;
    rotation[0] += r[1] * gr[2] - r[2] * gr[1];
    rotation[1] += r[2] * gr[0] - r[0] * gr[2];
    rotation[2] += r[0] * gr[1] - r[1] * gr[0];
  }
  // The mean enters only through m - c, so the centre takes the opposite.
  for (int j = 0; j < 3; ++j) {
    store_column(-mean[j], pose + 6 * i + j, 6);
    store_column(touched ? rotation[j] : zero, pose + 6 * i + 3 + j, 6);
  }
#endif

  gv gq[4];
  rotation_gradient(g.q, gR, gq);
  const gv along_q = gq[0] * g.q[0] + gq[1] * g.q[1] + gq[2] * g.q[2] + gq[3] * g.q[3];
  for (int j = 0; j < 4; ++j) {
    const gv value = (gq[j] - g.q[j] * along_q) / g.q_norm;
    gq[j] = touched ? value : zero;
  }
  store_columns4(gq, g_quaternions + 4 * i);
  gv gs[3];
  for (int k = 0; k < 3; ++k) {
    const gi moves = touched & (g.raw_scale[k] >= g.scale[k]);
    const gv value = -view.w[k] * g.w[k] * scale_log_derivative(g.scale[k]);
    gs[k] = moves ? value : zero;
  }
  store_columns3(gs[0], gs[1], gs[2], g_scales + 3 * i);
  store_column(touched ? v[12] * g.opacity * (1.0f - g.opacity) : zero, g_opacities + i, 1);
#if ACCUMULATE
  add_rows(g_means + 3 * i, 3, old_means);
  add_rows(g_quaternions + 4 * i, 4, old_quaternions);
  add_rows(g_scales + 3 * i, 3, old_scales);
  add_rows(g_opacities + i, 1, old_opacities);
  add_rows(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, old_sh);
#endif
}
