// SPDX-License-Identifier: Apache-2.0
// Cones of rays (Amanatides 1984): where pixels are wider than Gaussians, a ray sees these as
// view_footprint.h shows them to a view. Beside a mean m, at t = <d, m - o>, a cone has the width
// f = width + spread t; axes below f are raised to it, and the opacity falls with the area of the
// outline. The outline is seen from the cone's apex, along u = spread (m - o) + width d, whatever
// mirrors lie between the apex and the ray's origin o. Included by ray_block.h.
#ifndef RS_TRACE_RAY_CONE_H
#define RS_TRACE_RAY_CONE_H

#include "shared/alpha.h"

// Number k of the Gaussians that are tested at once: of all, with TRAIL of the one in `lane`.
#if TRAIL
#define RS_BLOCK_NUMBER(k) (((__global const float*)block)[RS_BLOCK_FLOAT(k, lane)])
#else
#define RS_BLOCK_NUMBER(k) (block[k])
#endif

// From a mean to the ray's origin, and the width of the cone beside the mean.
typedef struct {
  bv x, y, z, width;
} ConePlace;

RS_INLINE ConePlace cone_place(const RayData* ray, __global const fv* block, const uint lane) {
  (void)lane;
  ConePlace at;
  at.x = ray->o.x - RS_BLOCK_NUMBER(RS_BLOCK_MEAN);
  at.y = ray->o.y - RS_BLOCK_NUMBER(RS_BLOCK_MEAN + 1);
  at.z = ray->o.z - RS_BLOCK_NUMBER(RS_BLOCK_MEAN + 2);
  at.width = ray->width - ray->spread * (at.x * ray->d.x + at.y * ray->d.y + at.z * ray->d.z);
  return at;
}

// A ray in units of a Gaussian's raised axes.
typedef struct {
  bv origin[3];  // from the mean
  bv direction[3];
} ConeMeeting;

RS_INLINE ConeMeeting cone_meets(const RayData* ray,
                                 __global const fv* block,
                                 const uint lane,
                                 const ConePlace at) {
  (void)lane;
  ConeMeeting out;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const bv a = RS_BLOCK_NUMBER(4 * k), b = RS_BLOCK_NUMBER(4 * k + 1);
    const bv c = RS_BLOCK_NUMBER(4 * k + 2);
    const bv whitening = 1.0f / fmax(RS_BLOCK_NUMBER(4 * k + 3), at.width);
    out.origin[k] = whitening * (a * at.x + b * at.y + c * at.z);
    out.direction[k] = whitening * (a * ray->d.x + b * ray->d.y + c * ray->d.z);
  }
  return out;
}

// What is left of the opacity: the own share of the squared area A^2 of the outline, which is
// proportional to det(S)^2 |S^-1 R^T u|^2, to half of RS_FOOTPRINT_POWER (footprint_dilution()).
RS_INLINE bv cone_dilution(const RayData* ray,
                           __global const fv* block,
                           const uint lane,
                           const ConePlace at) {
  (void)lane;
  const bv x = ray->width * ray->d.x - ray->spread * at.x;
  const bv y = ray->width * ray->d.y - ray->spread * at.y;
  const bv z = ray->width * ray->d.z - ray->spread * at.z;
  bv own = (bv)(1e-30f), raised = (bv)(1e-30f);  // a ray without width dilutes nothing
  bv volume = (bv)(1.0f);
  // GPUs have no registers for all axes at once.
#if TRAIL
#pragma unroll 1
#else
#pragma unroll
#endif
  for (int k = 0; k < 3; ++k) {
    const bv along = RS_BLOCK_NUMBER(4 * k) * x + RS_BLOCK_NUMBER(4 * k + 1) * y +
                     RS_BLOCK_NUMBER(4 * k + 2) * z;
    const bv scale = RS_BLOCK_NUMBER(4 * k + 3), reach = fmax(scale, at.width);
    own += along / scale * (along / scale);
    raised += along / reach * (along / reach);
    volume *= scale / reach;
  }
  const bv share = fmin(volume * sqrt(own / raised), (bv)(1.0f));
  return share * sqrt(sqrt(share));
}

// Q / 2 of an opacity, from that of a greater one; not positive where no ray meets what is left.
RS_INLINE bv cone_half_quantile(const bv half_quantile, const bv opacity) {
#if ADAPTIVE_RADIUS
  return fmin(half_quantile, log(opacity / RS_MIN_ALPHA));
#else
  (void)opacity;
  return half_quantile;
#endif
}

#endif
