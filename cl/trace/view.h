// SPDX-License-Identifier: Apache-2.0
// Gaussians in the axes of one camera, one per lane: what prepare_view writes into their lines and
// finalize_gradients differentiates.
#ifndef RS_TRACE_VIEW_H
#define RS_TRACE_VIEW_H

#include "shared/layout.h"
#include "trace/gaussian.h"

// Evaluated spherical harmonics, and floats kept per Gaussian: constants, so that their loops
// unroll and the functions above the degree fall away.
#ifndef SH_DEGREE
#define SH_DEGREE 0
#endif
#ifndef SH_COEFFICIENTS
#define SH_COEFFICIENTS ((SH_DEGREE + 1) * (SH_DEGREE + 1))
#endif
// With 1 no axis is thinner than the view's footprint (view_footprint.h).
#ifndef VIEW_FOOTPRINT
#define VIEW_FOOTPRINT 0
#endif
#ifndef LENS
#define LENS RS_LENS_PINHOLE
#endif
#define RS_SH_FUNCTIONS ((SH_DEGREE + 1) * (SH_DEGREE + 1))
#define RS_SH_REAL fv
#include "shared/sh.h"

// Beyond this slope of the mean's direction the projective form loses digits to cancellation; the
// general form takes over (docs/model.md).
#define RS_MAX_SLOPE 8.0f
// Thinner than this fraction of the distance is treated as this thick: it keeps p, q, r inside
// float's range.
#define RS_MIN_RELATIVE_SCALE 1e-7f

typedef struct {
  fv m[3];       // mean, camera axes
  fv offset[3];  // mean minus camera centre, world axes
  fv axis[9];    // columns r_k of the rotation in camera axes, axis[3 k + j]
  fv scale[3];   // standard deviations, raised to the least one
  fv w[3];       // 1 / scale
  fv raw_scale[3];
  fv q[4];  // unit quaternion
  fv q_norm;
  fv logit;  // of the opacity
  fv opacity;
} ViewGaussian;

// Distance of the mean from the camera.
fv view_distance(const ViewGaussian* g) {
  return sqrt(g->m[0] * g->m[0] + g->m[1] * g->m[1] + g->m[2] * g->m[2]);
}

// No axis is treated as thinner than this.
fv thinnest_axis(const fv distance) {
  return larger(RS_MIN_RELATIVE_SCALE * distance, (fv)(1e-12f));
}

#if VIEW_FOOTPRINT
#include "trace/view_footprint.h"
#endif

// Means minus camera centre of the Gaussians from number i on.
void load_offset(const size_t i, __global const float* means, const RsCamera* camera, fv* offset) {
  load_columns3(means + 3 * i, offset);
  for (int j = 0; j < 3; ++j) offset[j] -= camera->center[j];
}

// Loads the Gaussians from number i on; false in lanes where a parameter is not finite.
iv load_view_gaussian(const size_t i,
                      __global const float* means,
                      __global const float* quaternions,
                      __global const float* scales,
                      __global const float* opacities,
                      const RsCamera* camera,
                      ViewGaussian* g) {
  const float* V = camera->rotation;
  load_offset(i, means, camera, g->offset);
  for (int j = 0; j < 3; ++j) {
    g->m[j] = V[3 * j] * g->offset[0] + V[3 * j + 1] * g->offset[1] + V[3 * j + 2] * g->offset[2];
  }
  load_columns4(quaternions + 4 * i, g->q);
  g->q_norm = sqrt(g->q[0] * g->q[0] + g->q[1] * g->q[1] + g->q[2] * g->q[2] + g->q[3] * g->q[3]);
  for (int j = 0; j < 4; ++j) g->q[j] = g->q[j] / g->q_norm;
  fv R[9];
  rotation_matrix(g->q[0], g->q[1], g->q[2], g->q[3], R);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) {
      g->axis[3 * k + j] = V[3 * j] * R[k] + V[3 * j + 1] * R[3 + k] + V[3 * j + 2] * R[6 + k];
    }
  }
  const fv distance = view_distance(g);
#if VIEW_FOOTPRINT
  const fv least = larger(thinnest_axis(distance), footprint_axis(g, camera));
#else
  const fv least = thinnest_axis(distance);
#endif
  fv sum = distance + g->q_norm;
  load_columns3(scales + 3 * i, g->raw_scale);
  for (int k = 0; k < 3; ++k) {
    g->raw_scale[k] = rs_scale_of(g->raw_scale[k]);
    g->scale[k] = larger(g->raw_scale[k], least);
    g->w[k] = 1.0f / g->scale[k];
    sum += g->raw_scale[k];
  }
  g->logit = load_column(opacities + i, 1);
  g->opacity = rs_sigmoid(g->logit);
  return (fabs(sum + g->opacity) <= FLT_MAX) & (g->q_norm > 0.0f);
}

iv is_projective(const ViewGaussian* g) {
  const fv reach = RS_MAX_SLOPE * g->m[2];
  return (g->m[2] > 0.0f) & (fabs(g->m[0]) <= reach) & (fabs(g->m[1]) <= reach);
}

#endif
