// SPDX-License-Identifier: Apache-2.0
// finalize_group: what finalize_gradients does, with a Gaussian per work-item of GPUs. All rows but
// those of mean, quaternion and scales (40 bytes side by side) go through local memory
// (staged_rows.h). What is done comes one after the other, so that little is in registers at once:
// the colour's share of the mean, the SH coefficients, then the rest with the line's gradient read
// again; what the rest needs last waits in local memory meanwhile.
// Launch: groups of GROUP work-items for the Gaussians from number `begin` to `end`.
#define LANES 1
#ifndef GROUP
#define GROUP 64
#endif
#include "parallel/wave.h"
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
#if POSE && ACCUMULATE
#error "gradients of a pose are those of one view"
#endif

// Stages eight columns, from number `column` on, of the sums of the copies of the present rows'
// line gradients; leaves them in the first copy and zeros in the others.
void stage_copies(__global float* gradients,
                  const uint column,
                  const size_t copy_floats,
                  const uint copies,
                  __local StagedRows* staged) {
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint k = get_local_id(0); k < GROUP * 8; k += GROUP) {
    const uint row = k / 8;
    if (!staged->present[row]) continue;
    __global float* first = gradients + 16 * row + column + k % 8;
    float sum = *first;
    for (uint copy = 1; copy < copies; ++copy) {
      __global float* part = first + copy * copy_floats;
      if (*part == 0.0f) continue;
      sum += *part;
      *part = 0.0f;
      *first = sum;
    }
    staged->rows[row][k % 8] = sum;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

// The sum of what the work-item's row holds of them.
float staged_size(const __local float* row) {
  float sum = 0.0f;
  for (int k = 0; k < 8; ++k) sum += fabs(row[k]);
  return sum;
}

// Adds the products of the colour's gradient with RS_STAGE floats of the SH coefficients from
// number `column` on, of Gaussians whose rows are present.
void add_along(const int column,
               __global const float* sh,
               const float* by_color,
               __local StagedRows* staged,
               float* along) {
  const int count = min(3 * RS_SH_FUNCTIONS - column, RS_STAGE);
  if (count <= 0) return;
  stage_fetch(sh, 3 * SH_COEFFICIENTS, column, count, staged);
  const uint lane = get_local_id(0);
#pragma unroll
  for (int t = 0; t < RS_STAGE; ++t) {
    const int k = column + t;
    if (t < count) along[k / 3] += staged->rows[lane][t] * by_color[k % 3];
  }
}

// Stores RS_STAGE floats of the gradient of the SH coefficients from number `column` on.
void store_sh_gradient(const int column,
                       const float* basis,
                       const float* by_color,
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
    if (t < count) staged->rows[lane][t] = moves ? basis[k / 3] * by_color[k % 3] : 0.0f;
  }
  stage_store(staged, 0, count, g_sh, 3 * SH_COEFFICIENTS, column, ACCUMULATE);
}

// What parameter_gradient() needs of a Gaussian and view_gradient() does not, in the work-item's
// own row meanwhile. The barrier is for the compiler: behind it these numbers may have changed.
void park(__local float* row, const ViewGaussian* g, const float* mean) {
  for (int j = 0; j < 3; ++j) {
    row[j] = mean[j];
    row[3 + j] = g->raw_scale[j];
  }
  for (int j = 0; j < 4; ++j) row[6 + j] = g->q[j];
  row[10] = g->q_norm;
  row[11] = g->logit;
  barrier(CLK_LOCAL_MEM_FENCE);
}

void unpark(const __local float* row, ViewGaussian* g, float* mean) {
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int j = 0; j < 3; ++j) {
    mean[j] = row[j];
    g->raw_scale[j] = row[3 + j];
  }
  for (int j = 0; j < 4; ++j) g->q[j] = row[6 + j];
  g->q_norm = row[10];
  g->logit = row[11];
#if !VIEW_FOOTPRINT
  g->opacity = rs_sigmoid(g->logit);
#endif
}

// With the pose's gradient 16 lanes would spill.
#if POSE
#define RS_FINALIZE_WAVE
#else
#define RS_FINALIZE_WAVE RS_WAVE_OF_16
#endif

RS_FINALIZE_WAVE __attribute__((reqd_work_group_size(GROUP, 1, 1))) __kernel void finalize_group(
    RS_FINALIZE_ARGUMENTS) {
#if !POSE
  (void)pose;
#endif
#if SH_DEGREE == 0
  (void)sh;
#endif
  __local StagedRows staged;
  const RsCamera camera = camera_argument;
  const uint lane = get_local_id(0);
  const size_t first = begin + get_group_id(0) * GROUP;
  const bool exists = first + lane < end;
  const iv kind = exists ? bounds[first + lane].kind : RS_LINE_HIDDEN;
  __local float* row = staged.rows[lane];
  staged.present[lane] = kind != RS_LINE_HIDDEN;
  for (int k = 0; k < 8; ++k) row[k] = 0.0f;
  const size_t copy_floats = (size_t)finalize.gaussians * 16;
  stage_copies(line_gradients + 16 * first, 0, copy_floats, finalize.copies, &staged);
  const float shape = staged_size(row);
  stage_copies(line_gradients + 16 * first, 8, copy_floats, finalize.copies, &staged);
  const iv touched = shape + staged_size(row) != 0.0f;
  // Who is not touched reads what a neighbour reads, and stores zeros or nothing.
  const size_t i = touched ? first + lane : first;
  const uint stored = ACCUMULATE ? touched : exists;

  ColorGradient color;
  load_offset(i, means, &camera, color.n);
  color_direction(&color);
  for (int j = 0; j < 3; ++j)
    color.value[j] = touched && RS_COLOR_PASSES(lines[i].v[13 + j], row[5 + j]) ? row[5 + j] : 0.0f;
  ParameterGradient out;
  for (int j = 0; j < 3; ++j) out.mean[j] = 0.0f;
#if SH_DEGREE > 0
  float along[RS_SH_FUNCTIONS];
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) along[k] = 0.0f;
  barrier(CLK_LOCAL_MEM_FENCE);
  staged.present[lane] = touched;
  __global const float* coefficients = sh + first * 3 * SH_COEFFICIENTS;
  add_along(0, coefficients, color.value, &staged, along);
  add_along(RS_STAGE, coefficients, color.value, &staged, along);
  add_along(2 * RS_STAGE, coefficients, color.value, &staged, along);
  add_along(3 * RS_STAGE, coefficients, color.value, &staged, along);
  add_along(4 * RS_STAGE, coefficients, color.value, &staged, along);
  add_along(5 * RS_STAGE, coefficients, color.value, &staged, along);
  add_along(6 * RS_STAGE, coefficients, color.value, &staged, along);
  direction_gradient(&color, along, out.mean);
#endif
  rs_sh_basis(SH_DEGREE, color.n[0], color.n[1], color.n[2], color.basis);
  barrier(CLK_LOCAL_MEM_FENCE | CLK_GLOBAL_MEM_FENCE);  // other work-items have summed the copies
  staged.present[lane] = stored;
  __global float* sh_gradient = g_sh + first * 3 * SH_COEFFICIENTS;
  store_sh_gradient(0, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(2 * RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(3 * RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(4 * RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(5 * RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);
  store_sh_gradient(6 * RS_STAGE, color.basis, color.value, touched, &staged, sh_gradient);

  stage_fetch(line_gradients + 16 * first, 16, 0, 13, &staged);
  float v[16];
  for (int k = 0; k < 13; ++k) v[k] = row[k];
  // Before the Gaussian itself is read, so that less is in registers at once.
  float line[9];
  for (int k = 2; k < 9; ++k) line[k] = lines[i].v[k];
  take_shape_gradient(line, kind, v);
  ViewGaussian g;
  load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  float seen[4];
  screen_statistics(&g, v, touched, kind, finalize.screen_x, finalize.screen_y, seen);
#if ACCUMULATE
  seen[0] += screen[4 * i];
  seen[1] += screen[4 * i + 1];
  seen[2] = larger(seen[2], screen[4 * i + 2]);
  seen[3] += screen[4 * i + 3];
#endif
  for (int j = 0; j < 4; ++j) row[j] = seen[j];
  stage_store(&staged, 0, 4, screen + 4 * first, 4, 0, 0);

  ViewGradient view;
  park(row, &g, out.mean);
  view_gradient(&g, v, touched, kind, &view);
#if VIEW_FOOTPRINT
  barrier(CLK_LOCAL_MEM_FENCE);  // as in park()
  for (int j = 0; j < 3; ++j) g.raw_scale[j] = row[3 + j];
  g.opacity = rs_sigmoid(row[11]);
  FootprintGradient rest;
  axis_footprint_gradient(&g, v[12], &view, &rest);
  barrier(CLK_LOCAL_MEM_FENCE);
  mean_footprint_gradient(&g, &rest, &view);
#endif
  unpark(row, &g, out.mean);
  parameter_gradient(&g, &view, v[12], touched, &camera, &out);
  for (int j = 0; j < 3; ++j) {
    row[j] = out.mean[j];
    row[7 + j] = out.scale[j];
  }
  for (int j = 0; j < 4; ++j) row[3 + j] = out.quaternion[j];
  row[10] = out.opacity;
  stage_store(&staged, 0, 3, g_means + 3 * first, 3, 0, ACCUMULATE);
  stage_store(&staged, 3, 4, g_quaternions + 4 * first, 4, 0, ACCUMULATE);
  stage_store(&staged, 7, 3, g_scales + 3 * first, 3, 0, ACCUMULATE);
  stage_store(&staged, 10, 1, g_opacities + first, 1, 0, ACCUMULATE);
#if POSE
  float moves[6];
  pose_gradient(&g, &view, out.mean, touched, moves);
  for (int j = 0; j < 6; ++j) row[j] = moves[j];
  stage_store(&staged, 0, 6, pose + 6 * first, 6, 0, 0);
#endif
}
