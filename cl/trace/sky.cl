// SPDX-License-Identifier: Apache-2.0
// Light behind the Gaussians that depends on the direction alone: a sky as spherical harmonics in
// world axes, sh[3 k + channel], with the colour max(0, 0.5 + sum) of Gaussians (Kerbl et al.
// 2023). A picture over black becomes one over the sky: C + (1 - A) B. So how rays find Gaussians
// is none of its business: the gradient of a picture over the sky is that of one over black with
// dL/dA - <B, dL/dC> in place of dL/dA.
//
// show_sky: one work-item per pixel. image: planar R, G, B over black, A; R, G, B are changed.
// sky_gradient: one work-item per block of BLOCK pixels. Turns A of gradient = dL/d(R, G, B, A)
//   into that of the picture over black, in place; partials[3 block K + 3 k + channel], K
//   coefficients, are the block's part of dL/dsh.
// sum_sky: one work-item per number of sh; adds the blocks' parts in their order.
// Pixels that a lens does not see show black. Complexity: pixels times coefficients.
#include "shared/color.h"
#include "shared/sh.h"
#include "trace/lens.h"

#ifndef SKY_DEGREE
#define SKY_DEGREE 3
#endif
#define COEFFICIENTS ((SKY_DEGREE + 1) * (SKY_DEGREE + 1))
#ifndef BLOCK
#define BLOCK 256
#endif

// Functions of the direction of a pixel; false where it sees nothing.
bool sky_basis(const RsLensCamera* camera, uint pixel, float* basis) {
  float3 direction = (float3)(0.0f, 0.0f, 1.0f);
#if CAMERA_MODEL != RS_CAMERA_ORTHOGRAPHIC
  const uint row = pixel / (uint)camera->width;
  const uint column = pixel - row * (uint)camera->width;
  if (!lens_direction(camera, (float)column, (float)row, (float2)(0.5f), &direction)) return false;
#endif
  const float* m = camera->rotation;
  float3 d = direction.x * (float3)(m[0], m[1], m[2]) + direction.y * (float3)(m[3], m[4], m[5]) +
             direction.z * (float3)(m[6], m[7], m[8]);
  d /= sqrt(dot(d, d));
  rs_sh_basis(SKY_DEGREE, d.x, d.y, d.z, basis);
  return true;
}

float3 sky_color(const __global float* sh, const float* basis) {
  float3 color = (float3)(0.5f);
  for (int k = 0; k < COEFFICIENTS; ++k) color += basis[k] * vload3(k, sh);
  return fmin(fmax(color, 0.0f), RS_MAX_COLOR);
}

__kernel void show_sky(const RsLensCamera camera,
                       const __global float* restrict sh,
                       const uint pixels,
                       __global float* restrict image) {
  const size_t i = get_global_id(0);
  const size_t plane = pixels;
  float basis[COEFFICIENTS];
  if (i >= plane || !sky_basis(&camera, (uint)i, basis)) return;
  const float3 behind = (1.0f - image[3 * plane + i]) * sky_color(sh, basis);
  image[i] += behind.x;
  image[plane + i] += behind.y;
  image[2 * plane + i] += behind.z;
}

__kernel void sky_gradient(const RsLensCamera camera,
                           const __global float* restrict sh,
                           const uint pixels,
                           const __global float* restrict image,
                           __global float* restrict gradient,
                           __global float* restrict partials) {
  const size_t block = get_global_id(0);
  const size_t plane = pixels;
  const size_t begin = block * BLOCK;
  if (begin >= plane) return;
  const size_t end = min(begin + BLOCK, plane);
  float3 sums[COEFFICIENTS];
  for (int k = 0; k < COEFFICIENTS; ++k) sums[k] = (float3)(0.0f);
  for (size_t i = begin; i < end; ++i) {
    float basis[COEFFICIENTS];
    if (!sky_basis(&camera, (uint)i, basis)) continue;
    const float3 color = sky_color(sh, basis);
    const float3 g = (float3)(gradient[i], gradient[plane + i], gradient[2 * plane + i]);
    gradient[3 * plane + i] -= dot(color, g);
    const float3 passed = (1.0f - image[3 * plane + i]) * g;
    const float3 counted = select((float3)(0.0f), passed, isgreater(color, (float3)(0.0f)));
    for (int k = 0; k < COEFFICIENTS; ++k) sums[k] += basis[k] * counted;
  }
  for (int k = 0; k < COEFFICIENTS; ++k) vstore3(sums[k], block * COEFFICIENTS + k, partials);
}

__kernel void sum_sky(const __global float* restrict partials,
                      const uint blocks,
                      __global float* restrict gradient) {
  const uint k = get_global_id(0);
  if (k >= 3 * COEFFICIENTS) return;
  float sum = 0.0f;
  for (uint block = 0; block < blocks; ++block)
    sum += partials[(size_t)block * (3 * COEFFICIENTS) + k];
  gradient[k] = sum;
}
