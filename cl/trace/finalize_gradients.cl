// SPDX-License-Identifier: Apache-2.0
// finalize_gradients: carries the gradients of Gaussians' lines on to their parameters
// (view_gradient.h), once per Gaussian and view after all rays are summed. Sums the private copies
// of the line gradients in a fixed order, leaves the sum in the first copy and zeros in the others.
// One work-item per LANES Gaussians from number `begin` on, any local size; end - begin is a
// multiple of LANES. With POSE, per-Gaussian contributions to the camera's gradient are written
// too, 6 floats each. On GPUs: group_finalize.cl.
#include "trace/arguments.h"
#include "trace/view_gradient.h"

#ifndef POSE
#define POSE 0
#endif
// Adds to the gradients of the parameters, for the second and further faces of a lens.
#ifndef ACCUMULATE
#define ACCUMULATE 0
#endif
#if POSE && ACCUMULATE
#error "gradients of a pose are those of one view"
#endif

// Sums the copies of the line gradients of LANES Gaussians into columns; true in lanes that a ray
// touched.
iv sum_copies(__global float* gradients, const size_t copy_floats, const uint copies, fv* v) {
  fv touched = 0;
  for (uint c = 0; c < 16; c += LANES) {
    fv rows[LANES];
#pragma unroll
    for (uint i = 0; i < LANES; ++i) rows[i] = *(__global const fv*)(gradients + 16 * i + c);
    fv any_lane = 0;  // of single copies: their sum may cancel
    for (uint copy = 1; copy < copies; ++copy) {
      __global const float* p = gradients + copy * copy_floats + c;
#pragma unroll
      for (uint i = 0; i < LANES; ++i) {
        const fv part = *(__global const fv*)(p + 16 * i);
        rows[i] += part;
        any_lane += fabs(part);
      }
    }
    if (rs_any_of(any_lane != 0.0f)) {
#pragma unroll
      for (uint i = 0; i < LANES; ++i) *(__global fv*)(gradients + 16 * i + c) = rows[i];
      for (uint copy = 1; copy < copies; ++copy) {
        __global float* p = gradients + copy * copy_floats + c;
#pragma unroll
        for (uint i = 0; i < LANES; ++i) *(__global fv*)(p + 16 * i) = (fv)(0.0f);
      }
    }
    transpose(rows, v + c);
  }
  for (int k = 0; k < 16; ++k) touched += fabs(v[k]);
  return touched != 0.0f;
}

#if ACCUMULATE
// The values of LANES Gaussians as they lie in memory, and adding them to what has been written.
void load_rows(__global const float* p, const uint stride, fv* rows) {
  for (uint k = 0; k < stride; ++k) rows[k] = *(__global const rs_unaligned*)(p + k * LANES);
}
void add_rows(__global float* p, const uint stride, const fv* rows) {
  for (uint k = 0; k < stride; ++k) *(__global rs_unaligned*)(p + k * LANES) += rows[k];
}
#endif

__kernel void finalize_gradients(RS_FINALIZE_ARGUMENTS) {
#if !POSE
  (void)pose;
#endif
#if SH_DEGREE == 0
  (void)sh;
#endif
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
  const RsCamera camera = camera_argument;
  fv box[8];
  load_records8((__global const float*)(bounds + i), box);
  const iv kind = rs_as_int(box[6]);
  fv v[16];
  iv touched = kind != RS_LINE_HIDDEN;
  if (rs_any_of(touched)) {
    touched =
        sum_copies(line_gradients + 16 * i, (size_t)finalize.gaussians * 16, finalize.copies, v);
  }
  if (!rs_any_of(touched)) {
#if !ACCUMULATE
    clear_columns(g_means + 3 * i, 3);
    clear_columns(g_quaternions + 4 * i, 4);
    clear_columns(g_scales + 3 * i, 3);
    clear_columns(g_opacities + i, 1);
    clear_columns(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);
    clear_columns(screen + 4 * i, 4);
#if POSE
    clear_columns(pose + 6 * i, 6);
#endif
#endif
    return;
  }

  ViewGaussian g;
  load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  fv line[16];
  load_columns(lines[i].v, 16, 16, line);
  ViewGradient view;
  take_shape_gradient(line, kind, v);
  view_gradient(&g, v, touched, kind, &view);
#if VIEW_FOOTPRINT
  FootprintGradient rest;
  axis_footprint_gradient(&g, v[12], &view, &rest);
  mean_footprint_gradient(&g, &rest, &view);
#endif
  fv seen[4];
  screen_statistics(&g, v, touched, kind, finalize.screen_x, finalize.screen_y, seen);
#if ACCUMULATE
  fv before[4], old_means[3], old_quaternions[4], old_scales[3], old_opacities[1];
  fv old_sh[3 * SH_COEFFICIENTS];
  load_columns4(screen + 4 * i, before);
  load_rows(g_means + 3 * i, 3, old_means);
  load_rows(g_quaternions + 4 * i, 4, old_quaternions);
  load_rows(g_scales + 3 * i, 3, old_scales);
  load_rows(g_opacities + i, 1, old_opacities);
  load_rows(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, old_sh);
  seen[0] += before[0];
  seen[1] += before[1];
  seen[2] = larger(seen[2], before[2]);
  seen[3] += before[3];
#endif
  store_columns4(seen, screen + 4 * i);

  ColorGradient color;
  color_gradient(g.offset, line, v, touched, &color);
  ParameterGradient out;
  for (int j = 0; j < 3; ++j) out.mean[j] = 0;
  fv c[3 * SH_COEFFICIENTS];
#if SH_DEGREE > 0
  load_columns(sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, 3 * RS_SH_FUNCTIONS, c);
  fv along[RS_SH_FUNCTIONS];
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) {
    along[k] =
        c[3 * k] * color.value[0] + c[3 * k + 1] * color.value[1] + c[3 * k + 2] * color.value[2];
  }
  direction_gradient(&color, along, out.mean);
#endif
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) {
    for (int j = 0; j < 3; ++j) {
      c[3 * k + j] = touched ? color.basis[k] * color.value[j] : (fv)(0.0f);
    }
  }
  for (int k = 3 * RS_SH_FUNCTIONS; k < 3 * SH_COEFFICIENTS; ++k) c[k] = (fv)(0.0f);
  store_columns(c, 3 * SH_COEFFICIENTS, g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS);

  parameter_gradient(&g, &view, v[12], touched, &camera, &out);
  store_columns3(out.mean[0], out.mean[1], out.mean[2], g_means + 3 * i);
  store_columns4(out.quaternion, g_quaternions + 4 * i);
  store_columns3(out.scale[0], out.scale[1], out.scale[2], g_scales + 3 * i);
  store_column(out.opacity, g_opacities + i, 1);
#if POSE
  fv moves[6];
  pose_gradient(&g, &view, out.mean, touched, moves);
  for (int j = 0; j < 6; ++j) store_column(moves[j], pose + 6 * i + j, 6);
#endif
#if ACCUMULATE
  add_rows(g_means + 3 * i, 3, old_means);
  add_rows(g_quaternions + 4 * i, 4, old_quaternions);
  add_rows(g_scales + 3 * i, 3, old_scales);
  add_rows(g_opacities + i, 1, old_opacities);
  add_rows(g_sh + i * 3 * SH_COEFFICIENTS, 3 * SH_COEFFICIENTS, old_sh);
#endif
}
