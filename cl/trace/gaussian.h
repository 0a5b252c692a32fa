// SPDX-License-Identifier: Apache-2.0
// Gaussians from their trained parameters: activations, rotation, effective quantile. One per lane,
// or with ONE_GAUSSIAN one alone, whatever else has LANES.
#ifndef RS_TRACE_GAUSSIAN_H
#define RS_TRACE_GAUSSIAN_H

#include "shared/alpha.h"
#include "trace/gaussian_lanes.h"

#ifdef ONE_GAUSSIAN
typedef float gv;
#else
typedef fv gv;
#endif

#define RS_ACTIVATED gv
#include "shared/activation.h"

#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif

// Q of a Gaussian; negative when no ray can meet it.
gv effective_quantile(float quantile, gv opacity) {
  (void)opacity;
#if ADAPTIVE_RADIUS
  const gv own = 2.0f * log(opacity / RS_MIN_ALPHA);
  return own < quantile ? own : (gv)(quantile);
#else
  return (gv)(quantile);
#endif
}

// Rotation matrix (row-major) of a unit quaternion, real part r.
void rotation_matrix(gv r, gv x, gv y, gv z, gv* R) {
  R[0] = 1.0f - 2.0f * (y * y + z * z);
  R[1] = 2.0f * (x * y - r * z);
  R[2] = 2.0f * (x * z + r * y);
  R[3] = 2.0f * (x * y + r * z);
  R[4] = 1.0f - 2.0f * (x * x + z * z);
  R[5] = 2.0f * (y * z - r * x);
  R[6] = 2.0f * (x * z - r * y);
  R[7] = 2.0f * (y * z + r * x);
  R[8] = 1.0f - 2.0f * (x * x + y * y);
}

#ifdef ONE_GAUSSIAN
void rotation_of(float4 q, float* R) { rotation_matrix(q.x, q.y, q.z, q.w, R); }
#endif

// dL/dq of the unit quaternion q (real part first) from dL/dR (row-major).
void rotation_gradient(const gv* q, const gv* g, gv* out) {
  out[0] = 2.0f * (q[1] * (g[7] - g[5]) + q[2] * (g[2] - g[6]) + q[3] * (g[3] - g[1]));
  out[1] = 2.0f * (q[2] * (g[1] + g[3]) + q[3] * (g[2] + g[6]) + q[0] * (g[7] - g[5])) -
           4.0f * q[1] * (g[4] + g[8]);
  out[2] = 2.0f * (q[1] * (g[1] + g[3]) + q[3] * (g[5] + g[7]) + q[0] * (g[2] - g[6])) -
           4.0f * q[2] * (g[0] + g[8]);
  out[3] = 2.0f * (q[1] * (g[2] + g[6]) + q[2] * (g[5] + g[7]) + q[0] * (g[3] - g[1])) -
           4.0f * q[3] * (g[0] + g[4]);
}

#endif
