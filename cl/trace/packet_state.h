// SPDX-License-Identifier: Apache-2.0
// What a packet has blended, and one more Gaussian for all its lanes.
#ifndef RS_TRACE_PACKET_STATE_H
#define RS_TRACE_PACKET_STATE_H

#include "trace/packet.h"
#include "trace/work_tally.h"

#ifndef WITH_DEPTH
#define WITH_DEPTH 0
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

// Candidates tested together.
#define RS_TOGETHER (PACKET > 1 ? 4 : 1)

// What packets are traced through: the lines of all Gaussians, the list of the tile (its
// candidates' references, least depths and quantiles), and where a ray ends.
typedef struct {
  __global const RsLine* lines;
  __global const uint* references;
  __global const float2* limits;
  float min_transmittance;
  int max_hits;
} PacketScene;

typedef struct {
  fv X, Y;
  fv T;       // transmittance behind the last hit
  fv T_last;  // and before it
  fv R, G, B;
  iv valid;  // lanes that are pixels of the image
  iv hits;
#if WITH_DEPTH
  fv depth_sum, median;
#endif
#if COUNT_WORK
  uint tally[RS_TALLIES];
#endif
} PacketState;

void packet_clear(PacketState* p) {
  p->T = p->T_last = (fv)(1.0f);
  p->R = p->G = p->B = (fv)(0.0f);
  p->hits = (iv)(0);
#if WITH_DEPTH
  p->depth_sum = p->median = (fv)(0.0f);
#endif
}

// Blends the Gaussian of line v with `alpha` behind transmittance `before` in the lanes `mine`.
// Lanes may take their hits in any order: the farthest has the least transmittance.
void packet_blend(PacketState* p,
                  __global const float* v,
                  const bool general,
                  const iv mine,
                  const fv before,
                  const fv alpha) {
  const fv a = select((fv)(0.0f), alpha, mine);
  const fv w = before * a;
  p->R += w * v[13];
  p->G += w * v[14];
  p->B += w * v[15];
  const fv after = before * (1.0f - a);
  p->T = select(p->T, after, mine & RS_MASK(after < p->T));
#if KEEP_HITS
  p->T_last = select(p->T_last, before, mine & RS_MASK(before < p->T_last));
#endif
  p->hits -= mine;
#if WITH_DEPTH
  const PacketMeeting m = rs_meet(v, general, 0.0f, p->X, p->Y);
  const fv peak = m.along / m.direction2;
  p->depth_sum += w * select((fv)(0.0f), peak, mine);
  p->median = select(p->median, peak, mine & RS_MASK(before >= 0.5f) & RS_MASK(after < 0.5f));
#else
  (void)general;
#endif
}

// Writes what the packet at (px, py) has blended: planar R, G, B over the background and alpha;
// WITH_DEPTH: expected depth, median depth and hits; KEEP_HITS: the transmittances behind and
// before the last hit.
void packet_store(const PacketState* p,
                  __global float* restrict image,
                  __global float* restrict depth_image,
                  __global float* restrict transmittances,
                  const int width,
                  const int height,
                  const int px,
                  const int py,
                  const float4 background) {
  const size_t plane = (size_t)width * height;
  rs_store_pixels(image, width, height, px, py, p->R + p->T * background.x);
  rs_store_pixels(image + plane, width, height, px, py, p->G + p->T * background.y);
  rs_store_pixels(image + 2 * plane, width, height, px, py, p->B + p->T * background.z);
  rs_store_pixels(image + 3 * plane, width, height, px, py, 1.0f - p->T);
#if WITH_DEPTH
  const fv weight = 1.0f - p->T;
#if LENS == RS_LENS_AROUND
  const fv length = sqrt(1.0f + p->X * p->X + p->Y * p->Y);
#else
  const fv length = (fv)(1.0f);
#endif
  rs_store_pixels(depth_image, width, height, px, py,
                  select((fv)(0.0f), length * p->depth_sum / weight, RS_MASK(weight > 0.0f)));
  rs_store_pixels(depth_image + plane, width, height, px, py, length * p->median);
  rs_store_pixels(depth_image + 2 * plane, width, height, px, py, rs_to_float(p->hits));
#else
  (void)depth_image;
#endif
#if KEEP_HITS
  rs_store_pixels(transmittances, width, height, px, py, p->T);
  rs_store_pixels(transmittances + plane, width, height, px, py, p->T_last);
#else
  (void)transmittances;
#endif
}

// How the lanes of a packet meet a candidate; key orders the hits.
typedef struct {
  iv hit;
  fv key, alpha;  // alpha is 0 in lanes that miss
} PacketHit;

// Tests `count` candidates of one form together, step by step: while one waits for its root or its
// division, the next ones' are close enough in the instructions to be started. (No `restrict`: what
// inlining makes of it is unknown to Oclgrind.)
__attribute__((always_inline)) static void packet_hits(const PacketState* p,
                                                       __global const RsLine* lines,
                                                       const uint* references,
                                                       const float* quantiles,
                                                       const int count,
                                                       const bool general,
                                                       const iv among,
                                                       PacketHit* hits) {
  PacketMeeting m[RS_TOGETHER];
  fv inverse[RS_TOGETHER];
#pragma unroll
  for (int j = 0; j < count; ++j)
    m[j] = rs_meet(lines[references[j] >> 1].v, general, quantiles[j], p->X, p->Y);
#if PEAK_ORDER
#pragma unroll
  for (int j = 0; j < count; ++j) inverse[j] = 1.0f / m[j].direction2;
#pragma unroll
  for (int j = 0; j < count; ++j) {
    hits[j].key = m[j].along * inverse[j];
    hits[j].hit = m[j].inside & among & RS_MASK(hits[j].key >= 0.0f);
  }
#else
  // Near root by Viete's formula from the far one: no difference of near equals. The far root times
  // <d', d'> is `far`.
  fv far[RS_TOGETHER];
#pragma unroll
  for (int j = 0; j < count; ++j) {
    const float unit2 = rs_unit2(lines[references[j] >> 1].v, general);
    const fv discriminant = unit2 * (quantiles[j] * m[j].direction2 - m[j].numerator);
    far[j] = m[j].along + sqrt(discriminant > 0.0f ? discriminant : (fv)(0.0f));
  }
#pragma unroll
  for (int j = 0; j < count; ++j) inverse[j] = 1.0f / m[j].direction2;
#pragma unroll
  for (int j = 0; j < count; ++j) {
    __global const float* v = lines[references[j] >> 1].v;
    const float origin2 = rs_origin_distance2(v, general);
    hits[j].key = (origin2 - rs_unit2(v, general) * quantiles[j]) / far[j];
    hits[j].hit = m[j].inside & among & RS_MASK(hits[j].key >= 0.0f) & RS_MASK(far[j] > 0.0f);
  }
#endif
#pragma unroll
  for (int j = 0; j < count; ++j) {
    const fv response = rs_exp(-0.5f * (m[j].numerator * inverse[j]));
    hits[j].alpha = select((fv)(0.0f), lines[references[j] >> 1].v[12] * response, hits[j].hit);
  }
}

// What the packet's rays meet of one candidate.
PacketHit packet_hit(const PacketState* p,
                     const PacketScene scene,
                     const uint reference,
                     const float quantile,
                     const iv among) {
  PacketHit hit;
  if (reference & 1) {
    packet_hits(p, scene.lines, &reference, &quantile, 1, true, among, &hit);
  } else {
    packet_hits(p, scene.lines, &reference, &quantile, 1, false, among, &hit);
  }
  return hit;
}

#endif
