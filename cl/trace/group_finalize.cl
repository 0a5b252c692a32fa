// SPDX-License-Identifier: Apache-2.0
// finalize_group: what finalize_gradients does, with a Gaussian per work-item of GPUs. All rows but
// those of mean, quaternion and scales (40 bytes side by side) go through local memory
// (staged_rows.h); the colour comes first, so that its SH coefficients need no registers later.
// Launch: groups of GROUP work-items for the Gaussians from number `begin` to `end`.
#define VECTOR 1
#ifndef GROUP
#define GROUP 64
#endif
#include "trace/arguments.h"
#include "trace/staged_rows.h"
#include "trace/view_gradient.h"

#ifndef POSE
#define POSE 0
#endif
// Adds to the gradients of the parameters, for the second and further faces of a lens.
#ifndef ACCUMULATE
#define ACCUMULATE 0
#endif

// Stages the sums of the copies of the present rows' line gradients; leaves them in the first copy
// and zeros in the others.
void stage_copies(__global float* gradients,
                  const size_t copy_floats,
                  const uint copies,
                  __local StagedRows* staged) {
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint k = get_local_id(0); k < GROUP * 16; k += GROUP) {
    const uint row = k / 16;
    if (!staged->present[row]) continue;
    float sum = gradients[k];
    for (uint copy = 1; copy < copies; ++copy) {
      __global float* part = gradients + copy * copy_floats + k;
      if (*part == 0.0f) continue;
      sum += *part;
      *part = 0.0f;
      gradients[k] = sum;
    }
    staged->rows[row][k % 16] = sum;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

// Adds the products of the colour's slope with RS_STAGE floats of the SH coefficients from number
// `column` on, of Gaussians whose rows are present.
void add_along(const int column,
               __global const float* sh,
               const float* slope,
               __local StagedRows* staged,
               float* along) {
  const int count = min(3 * RS_SH_FUNCTIONS - column, RS_STAGE);
  if (count <= 0) return;
  stage_fetch(sh, 3 * SH_COEFFICIENTS, column, count, staged);
  const uint lane = get_local_id(0);
#pragma unroll
  for (int t = 0; t < RS_STAGE; ++t) {
    const int k = column + t;
    if (t < count) along[k / 3] += staged->rows[lane][t] * slope[k % 3];
  }
}

// Stores RS_STAGE floats of the gradient of the SH coefficients from number `column` on.
void store_sh_gradient(const int column,
                       const ColourGradient* colour,
                       const int touched,
                       __local StagedRows* staged,
                       __global float* g_sh) {
  const int count = min(3 * SH_COEFFICIENTS - column, RS_STAGE);
  if (count <= 0) return;
  const uint lane = get_local_id(0);
#pragma unroll
  for (int t = 0; t < RS_STAGE; ++t) {
    const int k = column + t;
    const bool moves = touched && k < 3 * RS_SH_FUNCTIONS;
    if (t < count)
      staged->rows[lane][t] = moves ? colour->basis[k / 3] * colour->slope[k % 3] : 0.0f;
  }
  stage_store(staged, 0, count, g_sh, 3 * SH_COEFFICIENTS, column, ACCUMULATE);
}

__attribute__((reqd_work_group_size(GROUP, 1, 1))) __kernel void finalize_group(
    const uint begin,
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
  __local StagedRows staged;
  const RsCamera camera = camera_argument;
  const uint lane = get_local_id(0);
  const size_t first = begin + get_group_id(0) * GROUP;
  const bool exists = first + lane < end;
  const gi kind = exists ? bounds[first + lane].kind : RS_LINE_HIDDEN;
  __local float* row = staged.rows[lane];
  staged.present[lane] = kind != RS_LINE_HIDDEN;
  for (int k = 0; k < 16; ++k) row[k] = 0.0f;
  stage_copies(line_gradients + 16 * first, (size_t)finalize.gaussians * 16, finalize.copies,
               &staged);
  float v[16];
  float sum = 0.0f;
  for (int k = 0; k < 16; ++k) {
    v[k] = row[k];
    sum += fabs(v[k]);
  }
  const gi touched = sum != 0.0f;
  // Who is not touched reads what a neighbour reads, and stores zeros or nothing.
  const size_t i = touched ? first + lane : first;
  const uint stored = ACCUMULATE ? touched : exists;

  float offset[3];
  load_offset(i, means, &camera, offset);
  float line[16];
  for (int k = 13; k < 16; ++k) line[k] = lines[i].v[k];
  ColourGradient colour;
  colour_gradient(offset, line, v, touched, &colour);
  ParameterGradient out;
  for (int j = 0; j < 3; ++j) out.mean[j] = 0.0f;
#if SH_DEGREE > 0
  float along[RS_SH_FUNCTIONS];
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) along[k] = 0.0f;
  staged.present[lane] = touched;
  __global const float* coefficients = sh + first * 3 * SH_COEFFICIENTS;
  add_along(0, coefficients, colour.slope, &staged, along);
  add_along(RS_STAGE, coefficients, colour.slope, &staged, along);
  add_along(2 * RS_STAGE, coefficients, colour.slope, &staged, along);
  add_along(3 * RS_STAGE, coefficients, colour.slope, &staged, along);
  add_along(4 * RS_STAGE, coefficients, colour.slope, &staged, along);
  direction_gradient(&colour, along, out.mean);
#endif
  staged.present[lane] = stored;
  __global float* slopes = g_sh + first * 3 * SH_COEFFICIENTS;
  store_sh_gradient(0, &colour, touched, &staged, slopes);
  store_sh_gradient(RS_STAGE, &colour, touched, &staged, slopes);
  store_sh_gradient(2 * RS_STAGE, &colour, touched, &staged, slopes);
  store_sh_gradient(3 * RS_STAGE, &colour, touched, &staged, slopes);
  store_sh_gradient(4 * RS_STAGE, &colour, touched, &staged, slopes);

  ViewGaussian g;
  load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  ViewGradient view;
  line_gradient(&g, v, touched, kind, &view);
  parameter_gradient(&g, &view, v[12], touched, &camera, &out);
  float seen[3];
  screen_statistics(&g, v, touched, kind, finalize.screen_x, finalize.screen_y, seen);
#if ACCUMULATE
  seen[0] += screen[3 * i];
  seen[1] += screen[3 * i + 1];
  seen[2] = larger(seen[2], screen[3 * i + 2]);
#endif
  for (int j = 0; j < 3; ++j) {
    row[j] = out.mean[j];
    row[7 + j] = out.scale[j];
    row[11 + j] = seen[j];
  }
  for (int j = 0; j < 4; ++j) row[3 + j] = out.quaternion[j];
  row[10] = out.opacity;
  stage_store(&staged, 0, 3, g_means + 3 * first, 3, 0, ACCUMULATE);
  stage_store(&staged, 3, 4, g_quaternions + 4 * first, 4, 0, ACCUMULATE);
  stage_store(&staged, 7, 3, g_scales + 3 * first, 3, 0, ACCUMULATE);
  stage_store(&staged, 10, 1, g_opacities + first, 1, 0, ACCUMULATE);
  stage_store(&staged, 11, 3, screen + 3 * first, 3, 0, 0);
#if POSE
  float moves[6];
  pose_gradient(&g, &view, out.mean, touched, moves);
  for (int j = 0; j < 6; ++j) row[j] = moves[j];
  stage_store(&staged, 0, 6, pose + 6 * first, 6, 0, 0);
#endif
}
