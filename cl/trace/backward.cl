// SPDX-License-Identifier: Apache-2.0
// trace_backward: gradient of the loss for the line of every Gaussian of the view, from the hit
// streams that trace_forward kept. A packet walks its stream last to first with the suffix colour
// (linear in the hits, no division where alpha = 1: only the last hit of a ray can be opaque, and
// its transmittance is stored), sums the 16 components of a Gaussian's line over its rays, and adds
// them to memory once.
//   PRIVATE_COPIES 1: work-item g of `groups` takes every groups-th tile and adds to its own copy
//   of the gradient
//                     lines: no atomics, the same sum every time.    global: groups
//   PRIVATE_COPIES 0: one copy, compare-and-swap adds.              global: packets of the band
// Components of a line's gradient follow the line; slot 2 (m_z, of which order makes no gradient)
// sums the per-ray lengths of the screen gradient instead, the densification signal of AbsGS (Ye et
// al. 2024).
#include "trace/hit_stream.h"
#include "trace/packet.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef PRIVATE_COPIES
#define PRIVATE_COPIES 0
#endif

#if PACKET == 16 || PACKET == 8
// Sums 8 vectors over their lanes at once: pairs of halves are added until one lane per vector is
// left.
float8 sum_rows8(float8 a, float8 b, float8 c, float8 d, float8 e, float8 f, float8 g, float8 h) {
  const float8 ae = (float8)(a.lo + a.hi, e.lo + e.hi), bf = (float8)(b.lo + b.hi, f.lo + f.hi);
  const float8 cg = (float8)(c.lo + c.hi, g.lo + g.hi), dh = (float8)(d.lo + d.hi, h.lo + h.hi);
  // Quarters: a c e g and b d f h.
  const float8 aceg = (float8)(ae.s01 + ae.s23, cg.s01 + cg.s23, ae.s45 + ae.s67, cg.s45 + cg.s67);
  const float8 bdfh = (float8)(bf.s01 + bf.s23, dh.s01 + dh.s23, bf.s45 + bf.s67, dh.s45 + dh.s67);
  const float4 even = aceg.s0246 + aceg.s1357;
  const float4 odd = bdfh.s0246 + bdfh.s1357;
  return (float8)(even.x, odd.x, even.y, odd.y, even.z, odd.z, even.w, odd.w);
}
#endif

float16 sum_lanes(const fv* v) {
#if PACKET == 16
#define H(i) (v[i].lo + v[i].hi)
#elif PACKET == 8
#define H(i) (v[i])
#endif
#if PACKET == 16 || PACKET == 8
  return (float16)(sum_rows8(H(0), H(1), H(2), H(3), H(4), H(5), H(6), H(7)),
                   sum_rows8(H(8), H(9), H(10), H(11), H(12), H(13), H(14), H(15)));
#undef H
#else
  return (float16)(rs_lane_sum(v[0]), rs_lane_sum(v[1]), rs_lane_sum(v[2]), rs_lane_sum(v[3]),
                   rs_lane_sum(v[4]), rs_lane_sum(v[5]), rs_lane_sum(v[6]), rs_lane_sum(v[7]),
                   rs_lane_sum(v[8]), rs_lane_sum(v[9]), rs_lane_sum(v[10]), rs_lane_sum(v[11]),
                   rs_lane_sum(v[12]), rs_lane_sum(v[13]), rs_lane_sum(v[14]), rs_lane_sum(v[15]));
#endif
}

void add_line(volatile __global float* target, float16 value) {
#if PRIVATE_COPIES
  *(__global float16*)target += value;
#else
  union {
    float16 v;
    float s[16];
  } part;
  part.v = value;
  for (int i = 0; i < 16; ++i) {
    if (part.s[i] == 0.0f) continue;
    volatile __global uint* word = (volatile __global uint*)(target + i);
    uint old = *word;
    for (;;) {
      const uint seen = atomic_cmpxchg(word, old, as_uint(as_float(old) + part.s[i]));
      if (seen == old) break;
      old = seen;
    }
  }
#endif
}

void packet_backward(const RsCamera* camera,
                     const int px,
                     const int py,
                     __global const RsLine* restrict lines,
                     __global const float* restrict image_gradient,
                     __global const float* restrict last_transmittance,
                     __global const uint2* restrict stream_ends,
                     __global const uint2* restrict pool,
                     const float4 background,
                     const float screen_x,
                     const float screen_y,
                     __global float* gradient) {
  const int width = camera->width, height = camera->height;
  const uint packets_x = (width + PACKET_WIDTH - 1) / PACKET_WIDTH;
  const uint2 tail = stream_ends[(py / PACKET_HEIGHT) * packets_x + px / PACKET_WIDTH];
  if (tail.x == RS_NO_CHUNK) return;
  const fv X = ((float)px + RS_LANE_X + 0.5f - camera->cx) / camera->fx;
  const fv Y = ((float)py + RS_LANE_Y + 0.5f - camera->cy) / camera->fy;
  const size_t plane = (size_t)width * height;
  const fv gR = rs_load_pixels(image_gradient, width, height, px, py);
  const fv gG = rs_load_pixels(image_gradient + plane, width, height, px, py);
  const fv gB = rs_load_pixels(image_gradient + 2 * plane, width, height, px, py);
  const fv gA = rs_load_pixels(image_gradient + 3 * plane, width, height, px, py);
  fv T = rs_load_pixels(last_transmittance, width, height, px, py);
  // Everything behind the current hit, as seen from just behind it, projected on the pixel's
  // gradient; alpha is a fourth colour channel that is 1 in every Gaussian and 0 in the background.
  fv suffix = background.x * gR + background.y * gG + background.z * gB;
  iv at_last = (iv)(-1);  // lanes that have not met their last hit yet
  uint chunk = tail.x;
  uint used = tail.y;
  while (chunk != RS_NO_CHUNK) {
    __global const uint2* entries = pool + (size_t)chunk * CHUNK;
    for (uint n = used - 1; n > 0; --n) {
      const uint2 entry = entries[n];
      const bool general = entry.x & 1;
      const iv mine = rs_lane_mask(entry.y);
      __global const float* v = lines[entry.x >> 1].v;
      const PacketMeeting m = rs_meet(v, general, 0.0f, X, Y);
      const fv inverse = 1.0f / m.direction2;
      const fv distance2 = m.numerator * inverse;
      const fv response = select((fv)(0.0f), rs_exp(-0.5f * distance2), mine);
      const fv alpha = v[12] * response;
      T = select(T / (1.0f - alpha), T, at_last | ~mine);
      at_last &= ~mine;
      const fv color = v[13] * gR + v[14] * gG + v[15] * gB + gA;
      const fv weight = T * alpha;
      const fv g_alpha = select((fv)(0.0f), T * (color - suffix), mine);
      suffix += alpha * (color - suffix);
      const fv g_distance2 = -0.5f * alpha * g_alpha;
      fv g[16];
      g[12] = g_alpha * response;
      g[13] = weight * gR;
      g[14] = weight * gG;
      g[15] = weight * gB;
      if (!general) {
        const fv dx = X - v[0];
        const fv dy = Y - v[1];
        const fv gN = g_distance2 * inverse;
        const fv gD = -gN * distance2;
        const fv gNx = gN * dx, gNy = gN * dy, gDx = gD * dx, gDy = gD * dy;
        g[0] = -2.0f * (gNx * v[3] + gNy * v[4] + gD * v[7] + gDx * v[9] + gDy * v[10]);
        g[1] = -2.0f * (gNx * v[4] + gNy * v[5] + gD * v[8] + gDx * v[10] + gDy * v[11]);
        g[2] = sqrt(g[0] * g[0] * (screen_x * screen_x) + g[1] * g[1] * (screen_y * screen_y));
        g[3] = gNx * dx;
        g[4] = 2.0f * gNx * dy;
        g[5] = gNy * dy;
        g[6] = gD;
        g[7] = 2.0f * gDx;
        g[8] = 2.0f * gDy;
        g[9] = gDx * dx;
        g[10] = 2.0f * gDx * dy;
        g[11] = gDy * dy;
      } else {
        // g_o' = 2 g v with the residual v = o' + peak d'; g_d' = peak g_o'.
        const fv peak = m.along * inverse;
        for (int k = 0; k < 3; ++k) {
          const fv direction = v[3 * k] * X + v[3 * k + 1] * Y + v[3 * k + 2];
          const fv g_origin = 2.0f * g_distance2 * (v[9 + k] + peak * direction);
          const fv g_direction = peak * g_origin;
          g[3 * k] = g_direction * X;
          g[3 * k + 1] = g_direction * Y;
          g[3 * k + 2] = g_direction;
          g[9 + k] = g_origin;
        }
      }
      add_line(gradient + (size_t)(entry.x >> 1) * 16, sum_lanes(g));
    }
    chunk = entries[0].x;
    used = CHUNK;
  }
}

__kernel void trace_backward(const uint count,
                             const uint groups,
                             __global const RsLine* restrict lines,
                             __global const float* restrict image_gradient,
                             __global const float* restrict last_transmittance,
                             __global const uint2* restrict stream_ends,
                             __global const uint2* restrict pool,
                             const RsCamera camera_argument,
                             const uint tiles_x,
                             const uint tile_row,
                             const uint tile_rows,
                             const float4 background,
                             const float screen_x,
                             const float screen_y,
                             __global float* restrict gradients) {
  const RsCamera camera = camera_argument;
#if PRIVATE_COPIES
  const uint group = get_global_id(0);
  __global float* gradient = gradients + (size_t)group * count * 16;
  for (uint tile = group; tile < tiles_x * tile_rows; tile += groups) {
    const int x0 = tile % tiles_x * TILE;
    const int y0 = (tile_row + tile / tiles_x) * TILE;
    for (int y = y0; y < min(y0 + TILE, camera.height); y += PACKET_HEIGHT) {
      for (int x = x0; x < min(x0 + TILE, camera.width); x += PACKET_WIDTH) {
        packet_backward(&camera, x, y, lines, image_gradient, last_transmittance, stream_ends, pool,
                        background, screen_x, screen_y, gradient);
      }
    }
  }
#else
  const int x = get_global_id(0) * PACKET_WIDTH;
  const int y = get_global_id(1) * PACKET_HEIGHT + tile_row * TILE;
  if (x >= camera.width || y >= camera.height) return;
  packet_backward(&camera, x, y, lines, image_gradient, last_transmittance, stream_ends, pool,
                  background, screen_x, screen_y, gradients);
#endif
}
