// SPDX-License-Identifier: Apache-2.0
// A Gaussian in the axes of one camera: what prepare_view writes into its line and
// finalize_gradients differentiates.
#ifndef RS_TRACE_VIEW_H
#define RS_TRACE_VIEW_H

#include "shared/layout.h"
#include "trace/gaussian.h"

// Beyond this slope of the mean's direction the projective form loses digits to cancellation; the
// general form takes over (docs/model.md).
#define RS_MAX_SLOPE 16.0f
// Thinner than this fraction of the distance is treated as this thick: it keeps a, b, c inside
// float's range.
#define RS_MIN_RELATIVE_SCALE 1e-7f

typedef struct {
  float m[3];      // mean, camera axes
  float axis[9];   // columns r_k of the rotation in camera axes, axis[3 k + j]
  float scale[3];  // standard deviations, floored
  float w[3];      // 1 / scale
  float raw_scale[3];
  float4 q;  // unit quaternion
  float q_norm;
  float opacity;
} ViewGaussian;

// False when a parameter is not finite.
bool load_view_gaussian(const uint i,
                        __global const float* means,
                        __global const float* quaternions,
                        __global const float* scales,
                        __global const float* opacities,
                        const RsCamera* camera,
                        ViewGaussian* g) {
  const float d0 = means[3 * i] - camera->center[0];
  const float d1 = means[3 * i + 1] - camera->center[1];
  const float d2 = means[3 * i + 2] - camera->center[2];
  const float* V = camera->rotation;
  for (int j = 0; j < 3; ++j) g->m[j] = V[3 * j] * d0 + V[3 * j + 1] * d1 + V[3 * j + 2] * d2;
  const float4 q = vload4(i, quaternions);
  g->q_norm = sqrt(dot(q, q));
  g->q = q / g->q_norm;
  float R[9];
  rotation_of(g->q, R);
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) {
      g->axis[3 * k + j] = V[3 * j] * R[k] + V[3 * j + 1] * R[3 + k] + V[3 * j + 2] * R[6 + k];
    }
  }
  const float distance = sqrt(g->m[0] * g->m[0] + g->m[1] * g->m[1] + g->m[2] * g->m[2]);
  const float floor_scale = fmax(RS_MIN_RELATIVE_SCALE * distance, 1e-12f);
  float sum = distance + g->q_norm;
  for (int k = 0; k < 3; ++k) {
    g->raw_scale[k] = activated_scale(scales[3 * i + k]);
    g->scale[k] = fmax(g->raw_scale[k], floor_scale);
    g->w[k] = 1.0f / g->scale[k];
    sum += g->raw_scale[k];
  }
  g->opacity = sigmoid(opacities[i]);
  return isfinite(sum + g->opacity) && g->q_norm > 0.0f;
}

bool is_projective(const ViewGaussian* g) {
  return g->m[2] > 0.0f && fabs(g->m[0]) <= RS_MAX_SLOPE * g->m[2] &&
         fabs(g->m[1]) <= RS_MAX_SLOPE * g->m[2];
}

#endif
