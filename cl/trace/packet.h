// SPDX-License-Identifier: Apache-2.0
// The unit of tracing: PACKET camera rays (a small block of pixels) in one vector. Written once for
// every width; OpenCL's comparisons yield -1 in vectors and 1 in scalars, hence RS_MASK.
#ifndef RS_TRACE_PACKET_H
#define RS_TRACE_PACKET_H

#include "shared/layout.h"

#ifndef PACKET
#define PACKET 4
#endif

#if PACKET == 1
typedef float fv;
typedef int iv;
#define RS_MASK(comparison) (-(comparison))
#define PACKET_WIDTH 1
#define PACKET_HEIGHT 1
#define RS_LANE_X (0.0f)
#define RS_LANE_Y (0.0f)
#define RS_LANE_INDEX (0)
#define rs_load_float(p) (*(p))
#else
#define RS_MASK(comparison) (comparison)
#if PACKET == 2
typedef float2 fv;
typedef int2 iv;
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 1
#define RS_LANE_X ((fv)(0, 1))
#define RS_LANE_Y ((fv)(0, 0))
#define RS_LANE_INDEX ((iv)(0, 1))
#define rs_load_float(p) vload2(0, p)
#elif PACKET == 4
typedef float4 fv;
typedef int4 iv;
#define PACKET_WIDTH 2
#define PACKET_HEIGHT 2
#define RS_LANE_X ((fv)(0, 1, 0, 1))
#define RS_LANE_Y ((fv)(0, 0, 1, 1))
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3))
#define rs_load_float(p) vload4(0, p)
#elif PACKET == 8
typedef float8 fv;
typedef int8 iv;
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 2
#define RS_LANE_X ((fv)(0, 1, 2, 3, 0, 1, 2, 3))
#define RS_LANE_Y ((fv)(0, 0, 0, 0, 1, 1, 1, 1))
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3, 4, 5, 6, 7))
#define rs_load_float(p) vload8(0, p)
#elif PACKET == 16
typedef float16 fv;
typedef int16 iv;
#define PACKET_WIDTH 4
#define PACKET_HEIGHT 4
#define RS_LANE_X ((fv)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define RS_LANE_Y ((fv)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define rs_load_float(p) vload16(0, p)
#endif
#endif

// One bit per lane whose mask is set, lane 0 lowest.
uint rs_lane_bits(iv mask) {
#if PACKET == 1
  return mask & 1;
#else
  const iv bit = mask & ((iv)(1) << RS_LANE_INDEX);
#if PACKET == 16
  const int8 b8 = bit.lo | bit.hi;
  const int4 b4 = b8.lo | b8.hi;
#elif PACKET == 8
  const int4 b4 = bit.lo | bit.hi;
#elif PACKET == 4
  const int4 b4 = bit;
#endif
#if PACKET == 2
  return bit.x | bit.y;
#else
  const int2 b2 = b4.lo | b4.hi;
  return b2.x | b2.y;
#endif
#endif
}

// Lanes whose bit is set.
iv rs_lane_mask(uint bits) {
#if PACKET == 1
  return -(int)(bits & 1);
#else
  return ((iv)(bits) & ((iv)(1) << RS_LANE_INDEX)) != 0;
#endif
}

uint rs_lowest_bit(uint bits) { return 31 - clz(bits & -bits); }

// Sum over the lanes.
float rs_lane_sum(fv v) {
#if PACKET == 1
  return v;
#elif PACKET == 2
  return v.x + v.y;
#else
#if PACKET == 16
  const float8 v8 = v.lo + v.hi;
  const float4 v4 = v8.lo + v8.hi;
#elif PACKET == 8
  const float4 v4 = v.lo + v.hi;
#else
  const float4 v4 = v;
#endif
  const float2 v2 = v4.lo + v4.hi;
  return v2.x + v2.y;
#endif
}

// A row of pixels of a packet stored to or loaded from an image plane; `width` and `height` bound
// the image.
void rs_store_pixels(__global float* plane, int width, int height, int x, int y, fv value) {
#if PACKET == 1
  if (x < width && y < height) plane[(size_t)y * width + x] = value;
#else
  union {
    fv v;
    float s[PACKET];
  } lanes;
  lanes.v = value;
  for (int j = 0; j < PACKET_HEIGHT && y + j < height; ++j) {
    for (int i = 0; i < PACKET_WIDTH && x + i < width; ++i) {
      plane[(size_t)(y + j) * width + x + i] = lanes.s[j * PACKET_WIDTH + i];
    }
  }
#endif
}

fv rs_load_pixels(__global const float* plane, int width, int height, int x, int y) {
#if PACKET == 1
  return x < width && y < height ? plane[(size_t)y * width + x] : 0.0f;
#else
  union {
    fv v;
    float s[PACKET];
  } lanes;
  lanes.v = (fv)(0.0f);
  for (int j = 0; j < PACKET_HEIGHT && y + j < height; ++j) {
    for (int i = 0; i < PACKET_WIDTH && x + i < width; ++i) {
      lanes.s[j * PACKET_WIDTH + i] = plane[(size_t)(y + j) * width + x + i];
    }
  }
  return lanes.v;
#endif
}

// Squared whitened distance of the packet's rays to a Gaussian, depth of the maximum response and
// <d', d'>.
typedef struct {
  fv distance2;
  fv peak;
  fv direction2;
} PacketResponse;

// v: the line; X, Y: tangent coordinates of the rays (d = (X, Y, 1) in camera axes, t is depth
// along z).
PacketResponse rs_projective_response(__global const float* v, fv X, fv Y) {
  PacketResponse r;
  const fv dx = X - v[0];
  const fv dy = Y - v[1];
  const fv N = dx * (v[3] * dx + 2.0f * v[4] * dy) + v[5] * dy * dy;
  const fv e = v[7] * dx + v[8] * dy;
  r.direction2 = v[6] + 2.0f * e + dx * (v[9] * dx + 2.0f * v[10] * dy) + v[11] * dy * dy;
  const fv inverse = 1.0f / r.direction2;
  r.distance2 = N * inverse;
  r.peak = v[2] * (v[6] + e) * inverse;
  return r;
}

// The residual vector is formed before its norm (docs/model.md).
PacketResponse rs_general_response(__global const float* v, fv X, fv Y) {
  PacketResponse r;
  const fv d0 = v[0] * X + v[1] * Y + v[2];
  const fv d1 = v[3] * X + v[4] * Y + v[5];
  const fv d2 = v[6] * X + v[7] * Y + v[8];
  r.direction2 = d0 * d0 + d1 * d1 + d2 * d2;
  r.peak = -(v[9] * d0 + v[10] * d1 + v[11] * d2) / r.direction2;
  const fv r0 = v[9] + r.peak * d0;
  const fv r1 = v[10] + r.peak * d1;
  const fv r2 = v[11] + r.peak * d2;
  r.distance2 = r0 * r0 + r1 * r1 + r2 * r2;
  return r;
}

PacketResponse rs_response(__global const float* v, bool general, fv X, fv Y) {
  return general ? rs_general_response(v, X, Y) : rs_projective_response(v, X, Y);
}

// |o'|^2: squared whitened distance of the camera to the mean.
float rs_origin_distance2(__global const float* v, bool general) {
  return general ? v[9] * v[9] + v[10] * v[10] + v[11] * v[11] : v[6] * v[2] * v[2];
}

#endif
