// SPDX-License-Identifier: Apache-2.0
// The normal of every Gaussian, its shortest axis turned towards the camera (Jiang et al.
// 2024, GaussianShader), as the spherical harmonics of degree 0 whose colour is 0.5 + 0.5 n: so a
// picture of normals over black is one of colours, 0.5 sum w n + 0.5 A, by whatever way rays find
// Gaussians.
//
// gaussian_normals: one work-item per Gaussian; scales before their activation, which keeps their
//   order. eye: the camera's centre, or with eye.w = 0 the direction in which all rays go. n = 0
//   for a quaternion of length 0. O(1) each.
#include "shared/sh.h"

__kernel void gaussian_normals(__global const float* restrict means,
                               __global const float* restrict quaternions,
                               __global const float* restrict scales,
                               const float4 eye,
                               const uint count,
                               __global float* restrict sh) {
  const size_t i = get_global_id(0);
  if (i >= count) return;
  const float4 raw = vload4(i, quaternions);
  // Divided by the largest entry first: squares neither overflow nor vanish.
  const float largest = fmax(fmax(fabs(raw.x), fabs(raw.y)), fmax(fabs(raw.z), fabs(raw.w)));
  float3 normal = (float3)(0.0f);
  if (largest > 0.0f) {
    const float4 scaled = raw / largest;
    const float4 q = scaled / sqrt(dot(scaled, scaled));
    const float r = q.x, x = q.y, y = q.z, z = q.w;
    const float3 s = vload3(i, scales);
    if (s.x <= s.y && s.x <= s.z) {
      normal =
          (float3)(1.0f - 2.0f * (y * y + z * z), 2.0f * (x * y + r * z), 2.0f * (x * z - r * y));
    } else if (s.y <= s.z) {
      normal =
          (float3)(2.0f * (x * y - r * z), 1.0f - 2.0f * (x * x + z * z), 2.0f * (y * z + r * x));
    } else {
      normal =
          (float3)(2.0f * (x * z + r * y), 2.0f * (y * z - r * x), 1.0f - 2.0f * (x * x + y * y));
    }
    const float3 away = eye.w == 0.0f ? eye.xyz : vload3(i, means) - eye.xyz;
    if (dot(normal, away) > 0.0f) normal = -normal;
  }
  vstore3(0.5f / RS_SH0 * normal, i, sh);
}
