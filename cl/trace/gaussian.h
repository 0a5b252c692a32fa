// SPDX-License-Identifier: Apache-2.0
// One Gaussian from its trained parameters: activations, rotation, effective quantile.
#ifndef RS_TRACE_GAUSSIAN_H
#define RS_TRACE_GAUSSIAN_H

#ifndef SIGMOID_SCALE
#define SIGMOID_SCALE 0  // 1: S = sigmoid(s) (the paper), 0: S = exp(s)
#endif
#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif

#define RS_ALPHA_MIN (1.0f / 255.0f)

float sigmoid(float x) { return 1.0f / (1.0f + exp(-x)); }

float activated_scale(float s) { return SIGMOID_SCALE ? sigmoid(s) : exp(s); }

// dS/ds divided by S.
float scale_log_derivative(float scale) { return SIGMOID_SCALE ? 1.0f - scale : 1.0f; }

// Q of a Gaussian; negative when no ray can meet it.
float effective_quantile(float quantile, float opacity) {
  (void)opacity;
#if ADAPTIVE_RADIUS
  return fmin(quantile, 2.0f * log(opacity / RS_ALPHA_MIN));
#else
  return quantile;
#endif
}

// Rotation matrix (row-major) of a unit quaternion (real part first).
void rotation_of(float4 q, float* R) {
  R[0] = 1.0f - 2.0f * (q.z * q.z + q.w * q.w);
  R[1] = 2.0f * (q.y * q.z - q.x * q.w);
  R[2] = 2.0f * (q.y * q.w + q.x * q.z);
  R[3] = 2.0f * (q.y * q.z + q.x * q.w);
  R[4] = 1.0f - 2.0f * (q.y * q.y + q.w * q.w);
  R[5] = 2.0f * (q.z * q.w - q.x * q.y);
  R[6] = 2.0f * (q.y * q.w - q.x * q.z);
  R[7] = 2.0f * (q.z * q.w + q.x * q.y);
  R[8] = 1.0f - 2.0f * (q.y * q.y + q.z * q.z);
}

// dL/dq of the unit quaternion q from dL/dR (row-major).
float4 rotation_gradient(float4 q, const float* g) {
  float4 out;
  out.x = 2.0f * (q.y * (g[7] - g[5]) + q.z * (g[2] - g[6]) + q.w * (g[3] - g[1]));
  out.y = 2.0f * (q.z * (g[1] + g[3]) + q.w * (g[2] + g[6]) + q.x * (g[7] - g[5])) -
          4.0f * q.y * (g[4] + g[8]);
  out.z = 2.0f * (q.y * (g[1] + g[3]) + q.w * (g[5] + g[7]) + q.x * (g[2] - g[6])) -
          4.0f * q.z * (g[0] + g[8]);
  out.w = 2.0f * (q.y * (g[2] + g[6]) + q.z * (g[5] + g[7]) + q.x * (g[3] - g[1])) -
          4.0f * q.w * (g[0] + g[4]);
  return out;
}

#endif
