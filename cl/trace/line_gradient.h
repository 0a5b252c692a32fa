// SPDX-License-Identifier: Apache-2.0
// Gradient of a Gaussian's line from that of one hit, per ray of a packet.
#ifndef RS_TRACE_LINE_GRADIENT_H
#define RS_TRACE_LINE_GRADIENT_H

#include "trace/backward_scene.h"
#include "trace/least_weight.h"

// What a pixel gains from each unit of T alpha that a Gaussian blends.
fv rs_projected(const Pixels* p, __global const float* v, const PacketMeeting* m) {
  const fv color = v[13] * p->gR + v[14] * p->gG + v[15] * p->gB + p->gA;
#if DEPTH_GRADIENT
  return color + p->gS * (m->along / m->direction2);
#else
  (void)m;
  return color;
#endif
}

// Numbers RS_PROJECTIVE_END to 11 of the gradient of a projective line are 0: there is nothing to
// add.
#define RS_PROJECTIVE_END (DEPTH_GRADIENT ? 11 : 10)

// By how much a ray blends more than LEAST_WEIGHT of a Gaussian, 0 where it blends nothing or its
// pixel has no gradient.
fv rs_beyond_least(const Pixels* p, const fv weight) {
  const fv told = fabs(p->gR) + fabs(p->gG) + fabs(p->gB) + fabs(p->gA);
  return select((fv)(0.0f), weight - LEAST_WEIGHT, RS_MASK(fmin(weight, told) > 0.0f));
}

#if LENS == RS_LENS_AROUND
// Length of a gradient with respect to the angle in which the mean at (x, y) is seen, from that
// with respect to its tangent coordinates.
fv rs_angular_length(const float x, const float y, const fv gx, const fv gy) {
  const fv radial = x * gx + y * gy;
  return sqrt((1.0f + x * x + y * y) * (gx * gx + gy * gy + radial * radial));
}
#endif

// Gradient of the line but for opacity and colour, from that of the squared distance. Each form
// meets the Gaussian by itself: behind one branch for both compilers may gather the line's numbers.
void line_gradient_projective(
    const Pixels* p, __global const float* v, const fv g_distance2, const fv weight, fv* g) {
  const PacketMeeting m = rs_meet_projective(v, 0.0f, p->X, p->Y);
  const fv inverse = 1.0f / m.direction2;
  const fv dx = p->X - v[0];
  const fv dy = p->Y - v[1];
  const fv toward = 1.0f + v[6] * dx + v[7] * dy;
  const fv near = toward * inverse;
  const fv distance2 = m.numerator * inverse;
  // N and D = toward^2 + kappa N
  fv gN = g_distance2 * near * near;
  fv g_toward = -2.0f * g_distance2 * near * distance2;
  fv g_kappa = -g_distance2 * distance2 * distance2;
#if DEPTH_GRADIENT
  // t = m_z toward / D
  const fv g_near = weight * p->gS;
  const fv through_D = g_near * v[2] * near;
  gN -= through_D * v[8] * inverse;
  g_toward += g_near * v[2] * inverse - 2.0f * through_D * near;
  g_kappa -= through_D * distance2;
  g[10] = g_near * near;
#endif
  g[9] = rs_beyond_least(p, weight);
  // N is the sum of the squares of p dx + q dy and of r dy.
  const fv gU = 2.0f * gN * (v[3] * dx + v[4] * dy), gV = 2.0f * gN * (v[5] * dy);
  g[0] = -(gU * v[3] + g_toward * v[6]);
  g[1] = -(gU * v[4] + gV * v[5] + g_toward * v[7]);
#if LENS == RS_LENS_AROUND
  g[2] = rs_angular_length(v[0], v[1], g[0], g[1]) * p->screen_x;
#else
  g[2] =
      sqrt(g[0] * g[0] * (p->screen_x * p->screen_x) + g[1] * g[1] * (p->screen_y * p->screen_y));
#endif
  g[3] = gU * dx;
  g[4] = gU * dy;
  g[5] = gV * dy;
  g[6] = g_toward * dx;
  g[7] = g_toward * dy;
  g[8] = g_kappa;
}

// g_o' = 2 g v with the residual v = o' + peak d'; g_d' = peak g_o'. The peak itself is
// -<o', d'> / <d', d'>.
void line_gradient_general(
    const Pixels* p, __global const float* v, const fv g_distance2, const fv weight, fv* g) {
  const PacketMeeting m = rs_meet_general(v, 0.0f, p->X, p->Y);
  const fv peak = m.along / m.direction2;
#if DEPTH_GRADIENT
  const fv g_depth = weight * p->gS / m.direction2;
#else
  (void)weight;
#endif
  for (int k = 0; k < 3; ++k) {
    const fv direction = v[3 * k] * p->X + v[3 * k + 1] * p->Y + v[3 * k + 2];
    fv g_origin = 2.0f * g_distance2 * (v[9 + k] + peak * direction);
    fv g_direction = peak * g_origin;
#if DEPTH_GRADIENT
    g_origin -= g_depth * direction;
    g_direction -= g_depth * (v[9 + k] + 2.0f * peak * direction);
#endif
    g[3 * k] = g_direction * p->X;
    g[3 * k + 1] = g_direction * p->Y;
    g[3 * k + 2] = g_direction;
    g[9 + k] = g_origin;
  }
}

// All 16 components of the gradient of a line from that of its alpha at one hit; weight is the
// transmittance in front of it times alpha.
void line_gradient(const Pixels* p,
                   const bool general,
                   __global const float* v,
                   const fv g_alpha,
                   const fv alpha,
                   const fv weight,
                   fv* g) {
  const fv g_distance2 = -0.5f * alpha * g_alpha;
  g[9] = g[10] = g[11] = (fv)(0.0f);
  g[12] = g_alpha * (alpha / v[12]);  // the response is alpha / opacity
  g[13] = weight * p->gR;
  g[14] = weight * p->gG;
  g[15] = weight * p->gB;
  if (general) {
    line_gradient_general(p, v, g_distance2, weight, g);
  } else {
    line_gradient_projective(p, v, g_distance2, weight, g);
  }
}

#endif
