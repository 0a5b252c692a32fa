// SPDX-License-Identifier: Apache-2.0
// Box of every Gaussian's confidence ellipsoid: half-width sqrt(Q Sigma_jj) along axis j, Sigma = R
// S S R^T (Byrski et al. 2025, eq. 2), grown by what float rounding can lose. Launch: at least
// count work-items; O(1) each.
#include "shared/layout.h"

// S = sigmoid(s) instead of exp(s).
#ifndef RS_SIGMOID_SCALE
#define RS_SIGMOID_SCALE 0
#endif
// Q shrinks to where opacity * response reaches 1/255; Gaussians below that are empty.
#ifndef RS_ADAPTIVE_RADIUS
#define RS_ADAPTIVE_RADIUS 0
#endif

#define RS_MIN_ALPHA (1.0f / 255.0f)
// Relative growth of a half-width, and slack per unit of the centre's magnitude (four half units in
// the last place).
#define RS_GROWTH 1.00001f
#define RS_CENTER_SLACK 2.4e-7f

__kernel void gaussian_bounds(__global const float* means,
                              __global const float* quaternions,
                              __global const float* scales,
                              __global const float* opacities,
                              __global RsAabb* boxes,
                              float quantile,
                              uint count) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float3 mean = vload3(i, means);
  const float4 raw = vload4(i, quaternions);  // r, i, j, k
  float3 scale = vload3(i, scales);
  const float opacity = opacities[i];
#if RS_SIGMOID_SCALE
  scale = 1.0f / (1.0f + exp(-scale));
#else
  scale = exp(scale);
#endif

  // Divided by the largest entry first: squares neither overflow nor vanish.
  const float largest = fmax(fmax(fabs(raw.x), fabs(raw.y)), fmax(fabs(raw.z), fabs(raw.w)));
  float4 q = raw / largest;
  q /= sqrt(dot(q, q));
  const float3 row_x = (float3)(1.0f - 2.0f * (q.z * q.z + q.w * q.w),
                                2.0f * (q.y * q.z - q.x * q.w), 2.0f * (q.y * q.w + q.x * q.z));
  const float3 row_y =
      (float3)(2.0f * (q.y * q.z + q.x * q.w), 1.0f - 2.0f * (q.y * q.y + q.w * q.w),
               2.0f * (q.z * q.w - q.x * q.y));
  const float3 row_z = (float3)(2.0f * (q.y * q.w - q.x * q.z), 2.0f * (q.z * q.w + q.x * q.y),
                                1.0f - 2.0f * (q.y * q.y + q.z * q.z));
  const float longest = fmax(scale.x, fmax(scale.y, scale.z));
  const float3 relative = longest > 0.0f ? scale / longest : (float3)(0.0f);
  const float3 x = row_x * relative;
  const float3 y = row_y * relative;
  const float3 z = row_z * relative;

  float squared_radius = quantile;
  bool visible = isfinite(opacity);
#if RS_ADAPTIVE_RADIUS
  // The limits give way by what rounding does to a logarithm near zero.
  const float alpha = 1.0f / (1.0f + exp(-opacity));
  visible = visible && alpha >= RS_MIN_ALPHA * 0.99999f;
  squared_radius = fmin(quantile, 2.0f * fmax(log(255.0f * alpha), 0.0f) + 1e-5f);
#endif
  const float3 deviation = sqrt((float3)(dot(x, x), dot(y, y), dot(z, z)));
  const float3 half_width = deviation * (sqrt(squared_radius) * longest * RS_GROWTH) +
                            fabs(mean) * RS_CENTER_SLACK + FLT_MIN;
  const float3 lo = mean - half_width;
  const float3 hi = mean + half_width;
  // NaN and infinity in the mean or the rotation arrive in the corners.
  const bool good = visible && all(isfinite(lo)) && all(isfinite(hi)) && all(isfinite(scale));
  vstore3(good ? lo : (float3)(FLT_MAX), 0, (__global float*)(boxes + i));
  vstore3(good ? hi : (float3)(-FLT_MAX), 1, (__global float*)(boxes + i));
}
