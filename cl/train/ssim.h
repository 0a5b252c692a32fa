// SPDX-License-Identifier: Apache-2.0
// SSIM (Wang et al. 2004) of a pixel of the pair u = x + y, v = x - y and its derivatives.
//
// With a = mu_u^2, b = mu_v^2, p = sigma_u^2, q = sigma_v^2 (window moments of u and v)
//   SSIM = (a - b + 2 C1)(p - q + 2 C2) / ((a + b + 2 C1)(p + q + 2 C2)),
// which needs four moments instead of five and has no cancellation where x is close to y. The
// gradient of sum SSIM is three windowed sums (model.md, "Loss"): w * E + u (w * F) + v (w * G)
// with E = dS/dmu_u + dS/dmu_v, F = 2 dS/d(w * u^2), G = 2 dS/d(w * v^2); the window is symmetric.
#ifndef RS_TRAIN_SSIM_H
#define RS_TRAIN_SSIM_H

#include "parallel/vector_lanes.h"

#define C1 0.0001f
#define C2 0.0009f

typedef struct {
  fv value, e, f, g;
} Ssim;

// SSIM and its derivatives from the windowed means of u, v, u^2 and v^2.
Ssim rs_ssim(fv mu, fv mv, fv square_u, fv square_v) {
  const fv a = mu * mu;
  const fv b = mv * mv;
  const fv p = square_u - a;
  const fv q = square_v - b;
  const fv bottom1 = a + b + 2.0f * C1;
  const fv bottom2 = p + q + 2.0f * C2;
  const fv inverse = 1.0f / (bottom1 * bottom2);
  const fv inverse1 = inverse * bottom2;
  const fv inverse2 = inverse * bottom1;
  const fv ratio1 = (a - b + 2.0f * C1) * inverse1;
  const fv ratio2 = (p - q + 2.0f * C2) * inverse2;
  const fv by_p = 2.0f * q * ratio1 * inverse2 * inverse2;
  const fv by_q = -ratio1 * (1.0f + ratio2) * inverse2;
  const fv by_a = 2.0f * b * ratio2 * inverse1 * inverse1 - by_p;
  const fv by_b = -ratio2 * (1.0f + ratio1) * inverse1 - by_q;
  Ssim out;
  out.value = ratio1 * ratio2;
  out.e = 2.0f * (mu * by_a + mv * by_b);
  out.f = 2.0f * by_p;
  out.g = 2.0f * by_q;
  return out;
}

#endif
