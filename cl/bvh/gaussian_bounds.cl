// SPDX-License-Identifier: Apache-2.0
// Box of every Gaussian's confidence ellipsoid: half-width sqrt(Q Sigma_jj) along axis j, Sigma = R
// S S R^T (Byrski et al. 2025, eq. 2), grown by what float rounding can lose. Launch: work-items of
// `chunk` consecutive Gaussians each; O(1) per Gaussian. Scalars without branches, so that
// compilers make vectors of a long loop (one work-item per Gaussian suits GPUs).
#include "shared/activation.h"
#include "shared/alpha.h"
#include "shared/layout.h"

// Q shrinks to where opacity * response reaches 1/255; Gaussians below that are empty.
#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif

// Relative growth of a half-width, and slack per unit of the centre's magnitude (four half units in
// the last place).
#define RS_GROWTH 1.00001f
#define RS_CENTER_SLACK 2.4e-7f

float larger(float a, float b) { return a > b ? a : b; }

int finite(float x) { return fabs(x) <= FLT_MAX; }

// The natural logarithm of a finite x that is 1 or more, to 1e-6 of it and 2e-7, by the series of
// the inverse hyperbolic tangent. The built-in function is a call on CPUs, which keeps the loop
// from becoming vectors.
float log_from_one(float x) {
  // x = m 2^e with m within [1/sqrt(2), sqrt(2)).
  const int e = (as_int(x) - 0x3f3504f3) >> 23;
  const float m = as_float(as_int(x) - (e << 23));
  const float t = (m - 1.0f) / (m + 1.0f);
  const float tt = t * t;
  const float tail = tt * (1.0f / 3.0f + tt * (1.0f / 5.0f + tt * (1.0f / 7.0f + tt / 9.0f)));
  return (float)e * 0.693147181f + 2.0f * t * (1.0f + tail);
}

__kernel void gaussian_bounds(__global const float* restrict means,
                              __global const float* restrict quaternions,
                              __global const float* restrict scales,
                              __global const float* restrict opacities,
                              __global float* restrict boxes,
                              float quantile,
                              uint count,
                              uint chunk) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  for (uint i = begin; i < end; ++i) {
    // r, i, j, k, divided by the largest entry first: squares neither overflow nor vanish.
    __global const float* raw = quaternions + 4 * (size_t)i;
    const float largest =
        larger(larger(fabs(raw[0]), fabs(raw[1])), larger(fabs(raw[2]), fabs(raw[3])));
    float qr = raw[0] / largest;
    float qx = raw[1] / largest;
    float qy = raw[2] / largest;
    float qz = raw[3] / largest;
    const float shrink = 1.0f / sqrt(qr * qr + qx * qx + qy * qy + qz * qz);
    qr *= shrink;
    qx *= shrink;
    qy *= shrink;
    qz *= shrink;
    __global const float* parameter = scales + 3 * (size_t)i;
    const float sx = rs_scale_of(parameter[0]);
    const float sy = rs_scale_of(parameter[1]);
    const float sz = rs_scale_of(parameter[2]);
    const float longest = larger(sx, larger(sy, sz));
    const float inverse = longest > 0.0f ? longest : 1.0f;
    const float rx = sx / inverse;
    const float ry = sy / inverse;
    const float rz = sz / inverse;
    // Rows of R S / longest.
    const float xx = (1.0f - 2.0f * (qy * qy + qz * qz)) * rx;
    const float xy = 2.0f * (qx * qy - qr * qz) * ry;
    const float xz = 2.0f * (qx * qz + qr * qy) * rz;
    const float yx = 2.0f * (qx * qy + qr * qz) * rx;
    const float yy = (1.0f - 2.0f * (qx * qx + qz * qz)) * ry;
    const float yz = 2.0f * (qy * qz - qr * qx) * rz;
    const float zx = 2.0f * (qx * qz - qr * qy) * rx;
    const float zy = 2.0f * (qy * qz + qr * qx) * ry;
    const float zz = (1.0f - 2.0f * (qx * qx + qy * qy)) * rz;

    float squared_radius = quantile;
    int good = finite(opacities[i]) & finite(sx) & finite(sy) & finite(sz);
#if ADAPTIVE_RADIUS
    // The limits give way by what rounding does to a logarithm near zero.
    const float alpha = rs_sigmoid(opacities[i]);
    good = good & (alpha >= RS_MIN_ALPHA * 0.99999f);
    const float reach = 2.0f * log_from_one(larger(255.0f * alpha, 1.0f)) + 1e-5f;
    squared_radius = reach < quantile ? reach : quantile;
#endif
    const float radius = sqrt(squared_radius) * longest * RS_GROWTH;
    __global const float* mean = means + 3 * (size_t)i;
    const float hx =
        sqrt(xx * xx + xy * xy + xz * xz) * radius + fabs(mean[0]) * RS_CENTER_SLACK + FLT_MIN;
    const float hy =
        sqrt(yx * yx + yy * yy + yz * yz) * radius + fabs(mean[1]) * RS_CENTER_SLACK + FLT_MIN;
    const float hz =
        sqrt(zx * zx + zy * zy + zz * zz) * radius + fabs(mean[2]) * RS_CENTER_SLACK + FLT_MIN;
    // NaN and infinity in the mean or the rotation arrive in the corners.
    good = good & finite(mean[0] - hx) & finite(mean[1] - hy) & finite(mean[2] - hz) &
           finite(mean[0] + hx) & finite(mean[1] + hy) & finite(mean[2] + hz);
    __global float* box = boxes + 6 * (size_t)i;
    box[0] = good ? mean[0] - hx : FLT_MAX;
    box[1] = good ? mean[1] - hy : FLT_MAX;
    box[2] = good ? mean[2] - hz : FLT_MAX;
    box[3] = good ? mean[0] + hx : -FLT_MAX;
    box[4] = good ? mean[1] + hy : -FLT_MAX;
    box[5] = good ? mean[2] + hz : -FLT_MAX;
  }
}
