// SPDX-License-Identifier: Apache-2.0
// What a packet has blended, and one more Gaussian for all its lanes.
#ifndef RS_TRACE_PACKET_STATE_H
#define RS_TRACE_PACKET_STATE_H

#include "trace/packet.h"

#ifndef WITH_DEPTH
#define WITH_DEPTH 0
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

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

// How the lanes of `among` meet a candidate. Returns the lanes that hit; key orders the hits.
iv packet_hit(const PacketState* p,
              __global const float* v,
              const bool general,
              const float quantile,
              const iv among,
              fv* key,
              fv* alpha) {
  const PacketMeeting m = rs_meet(v, general, quantile, p->X, p->Y);
  iv hit = m.inside & among;
  const fv inverse = 1.0f / m.direction2;
  const fv distance2 = m.numerator * inverse;
#if PEAK_ORDER
  *key = m.along * inverse;
  hit &= RS_MASK(*key >= 0.0f);
#else
  // Near root by Viete's formula from the far one: no difference of near equals. The far root times
  // <d', d'> is `far`.
  const fv discriminant = quantile * m.direction2 - m.numerator;
  const fv far = m.along + sqrt(discriminant > 0.0f ? discriminant : (fv)(0.0f));
  *key = (rs_origin_distance2(v, general) - quantile) / far;
  hit &= RS_MASK(*key >= 0.0f) & RS_MASK(far > 0.0f);
#endif
  *alpha = select((fv)(0.0f), v[12] * rs_exp(-0.5f * distance2), hit);
  return hit;
}

#endif
