// SPDX-License-Identifier: Apache-2.0
// From the gradients of Gaussians' lines (prepare_view.cl) to those of their parameters: mean,
// unnormalised quaternion, scale parameter under either activation, opacity logit, SH coefficients
// (with the direction's dependence on the mean), the screen statistics that density control reads
// and the camera's gradient. Lanes that no ray touched may hold anything; they come out as zeros.
#ifndef RS_TRACE_VIEW_GRADIENT_H
#define RS_TRACE_VIEW_GRADIENT_H

#include "shared/color.h"
#include "trace/view.h"

// The lines' gradients have that of m_z too (line_gradient.h).
#ifndef DEPTH_GRADIENT
#define DEPTH_GRADIENT 0
#endif

typedef struct {
  fv m[3];
  fv axis[9];
  fv w[3];
} ViewGradient;

// Takes the gradients of a line after take_shape_gradient().
void projective_gradient(const ViewGaussian* g, const fv* v, ViewGradient* out) {
  const fv mx = g->m[0], my = g->m[1], mz = g->m[2];
  const fv iz = 1.0f / mz;
  fv P[3], gP[3];
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    P[k] = g->w[(k + 1) % 3] * g->w[(k + 2) % 3];
    out->m[k] = 0;
  }
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv rx = g->axis[3 * k], ry = g->axis[3 * k + 1], rz = g->axis[3 * k + 2];
    const fv w = g->w[k];
    const fv A = ry * mz - rz * my;
    const fv B = rz * mx - rx * mz;
    const fv gx = P[k] * (v[3] * A + v[4] * B);
    const fv gy = P[k] * (v[4] * A);
    const fv gA = P[k] * gx;
    const fv gB = P[k] * gy;
    gP[k] = A * gx + B * gy;
    const fv along = rx * mx + ry * my + rz * mz;
    const fv q = along * w;
    const fv by_slope = v[6] * rx + v[7] * ry;
    const fv gq = v[8] * q + by_slope * w;
    out->w[k] = by_slope * q + gq * along;
    out->axis[3 * k] = v[6] * q * w + gq * w * mx - gB * mz;
    out->axis[3 * k + 1] = v[7] * q * w + gq * w * my + gA * mz;
    out->axis[3 * k + 2] = gq * w * mz - gA * my + gB * mx;
    out->m[0] += gq * w * rx + gB * rz;
    out->m[1] += gq * w * ry - gA * rz;
    out->m[2] += gq * w * rz + gA * ry - gB * rx;
  }
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out->w[i] += gP[k] * g->w[j];
    out->w[j] += gP[k] * g->w[i];
    out->w[k] += v[5] / g->w[k];
  }
  out->m[0] += v[0] * iz;
  out->m[1] += v[1] * iz;
  out->m[2] += (v[10] - (v[0] * mx + v[1] * my) * iz) * iz;
}

// Writes the general gradient in place of the projective one, in the lanes where `general` holds.
void general_gradient(const ViewGaussian* g, const fv* v, const iv general, ViewGradient* out) {
  fv m[3] = {0, 0, 0};
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv w = g->w[k];
    const fv go = v[9 + k];
    fv along = 0, gw = 0;
#pragma unroll
    for (int j = 0; j < 3; ++j) {
      const fv r = g->axis[3 * k + j];
      along += r * g->m[j];
      gw += v[3 * k + j] * r;
      out->axis[3 * k + j] = general ? (v[3 * k + j] - go * g->m[j]) * w : out->axis[3 * k + j];
      m[j] -= go * w * r;
    }
    out->w[k] = general ? gw - go * along : out->w[k];
  }
#pragma unroll
  for (int j = 0; j < 3; ++j) out->m[j] = general ? m[j] : out->m[j];
}

// Gradients of what a line with gradient v, after take_shape_gradient(), was made of.
void view_gradient(
    const ViewGaussian* g, const fv* v, const iv touched, const iv kind, ViewGradient* out) {
  projective_gradient(g, v, out);
  const iv general = kind == RS_LINE_GENERAL;
  if (rs_any_of(touched & general)) general_gradient(g, v, general, out);
}

// Turns the gradients of p, q, r, e_x, e_y, kappa and m_z of a projective line, v[3..8] and v[10],
// into those of what they are made of (prepare_view.cl), n = -o' being the whitened mean, u_x = n x
// M_0 and u_y = n x M_1: twice that of |u_x|^2, that of <u_x, u_y>, r dL/dr, those of <n, M_0> and
// <n, M_1>, twice that of |n|^2, and m_z dL/dm_z.
void take_shape_gradient(const fv* line, const iv kind, fv* v) {
  const iv projective = kind == RS_LINE_PROJECTIVE;
  const fv inverse_p = 1.0f / line[3];
  const fv unit = line[2] * line[8];
  const fv by_p = v[3] * line[3], by_q = v[4] * line[4], by_r = v[5] * line[5];
  const fv by_slopes = v[6] * line[6] + v[7] * line[7];
  const fv per_p2 = line[2] * unit * inverse_p * inverse_p;
  v[3] = projective ? (by_p - by_q - by_r) * per_p2 : v[3];
  v[4] = projective ? v[4] * line[3] * per_p2 : v[4];
  v[5] = projective ? by_r : v[5];
  v[6] = projective ? v[6] * unit : v[6];
  v[7] = projective ? v[7] * unit : v[7];
  const fv by_scale = by_p + by_q;  // of m_z / |n|
  v[8] = projective ? -(by_scale + 2.0f * (line[8] * v[8] + by_slopes)) * line[8] : v[8];
#if DEPTH_GRADIENT
  const fv by_depth = line[2] * v[10];
#else
  const fv by_depth = 0;
#endif
  v[10] = projective ? by_scale + by_slopes + 2.0f * by_r + by_depth : v[10];
}

// What density control reads: screen gradient, the sum of its absolute values, 1 where a ray met,
// and by how much rays blend more than LEAST_WEIGHT.
void screen_statistics(const ViewGaussian* g,
                       const fv* v,
                       const iv touched,
                       const iv kind,
                       const float screen_x,
                       const float screen_y,
                       fv* out) {
  const fv zero = (fv)(0.0f);
  const iv counts = touched & (kind == RS_LINE_PROJECTIVE);
#if LENS == RS_LENS_AROUND
  (void)screen_y;
  const fv x0 = g->m[0] / g->m[2], y0 = g->m[1] / g->m[2];
  const fv across = x0 * v[0] + y0 * v[1];
  const fv on_screen =
      screen_x * sqrt((1.0f + x0 * x0 + y0 * y0) * (v[0] * v[0] + v[1] * v[1] + across * across));
#else
  (void)g;
  const fv on_screen = sqrt(v[0] * v[0] * screen_x * screen_x + v[1] * v[1] * screen_y * screen_y);
#endif
  out[0] = counts ? on_screen : zero;
  out[1] = counts ? v[2] : zero;
  out[2] = touched ? (fv)(1.0f) : zero;
  out[3] = counts ? v[9] : zero;
}

// What the colour of a Gaussian depends on: its direction n = (m - c) / |m - c| and max(0, .),
// which where it clamps passes nothing, or what raises the colour (shared/color.h).
typedef struct {
  fv n[3];
  fv inverse;  // 1 / |m - c|
  fv basis[RS_SH_FUNCTIONS];
  fv value[3];  // of R, G, B before they are clamped
} ColorGradient;

// Finds the direction of the colour from out->n = m - c.
void color_direction(ColorGradient* out) {
  fv* d = out->n;
  out->inverse = 1.0f / sqrt(larger(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], (fv)(1e-30f)));
#pragma unroll
  for (int j = 0; j < 3; ++j) d[j] = d[j] * out->inverse;
}

void color_gradient(
    const fv* offset, const fv* line, const fv* v, const iv touched, ColorGradient* out) {
  const fv zero = (fv)(0.0f);
#pragma unroll
  for (int j = 0; j < 3; ++j) out->n[j] = offset[j];
  color_direction(out);
#pragma unroll
  for (int j = 0; j < 3; ++j) {
    out->value[j] = (touched & RS_COLOR_PASSES(line[13 + j], v[13 + j])) ? v[13 + j] : zero;
  }
  rs_sh_basis(SH_DEGREE, out->n[0], out->n[1], out->n[2], out->basis);
}

// The share of the mean's gradient that comes from the colour; `along` holds per function the
// product of its coefficients with that gradient.
void direction_gradient(const ColorGradient* color, const fv* along, fv* mean) {
  const fv* n = color->n;
  fv gn[3];
  rs_sh_gradient(SH_DEGREE, n[0], n[1], n[2], along, gn);
  const fv radial = gn[0] * n[0] + gn[1] * n[1] + gn[2] * n[2];
#pragma unroll
  for (int j = 0; j < 3; ++j) mean[j] = (gn[j] - radial * n[j]) * color->inverse;
}

typedef struct {
  fv mean[3];  // holds the share of the colour before
  fv quaternion[4];
  fv scale[3];
  fv opacity;
} ParameterGradient;

#if VIEW_FOOTPRINT
// Gradients of the parts of the mean along the axes, and of the logarithm of the footprint.
typedef struct {
  fv along[3];
  fv size;
} FootprintGradient;

// Where axes were raised to the footprint (view_footprint.h): makes the gradients of the raised
// axes those of the own ones. `opacity` holds the gradient of what is left of the opacity, which g
// gets.
void axis_footprint_gradient(ViewGaussian* g,
                             const fv opacity,
                             ViewGradient* out,
                             FootprintGradient* rest) {
  FootprintShares s;
  footprint_shares(g, &s);
  g->opacity *= footprint_dilution(&s);
  const fv by_area = RS_FOOTPRINT_POWER * opacity * g->opacity;  // of the area's logarithm
  const fv inverse_kept = 1.0f / s.kept;
  const fv inverse_whitened = 1.0f / s.whitened;
  rest->size = 0;
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv w = g->w[k];
    const fv q = s.along[k] * w;
    const fv share = q * q * inverse_whitened;
    const fv grown = footprint_pair(&s, k) * inverse_kept;
    const iv raised = footprint_raised(&s, k);
    const fv by_axis = -out->w[k] * w - by_area * (1.0f - share);
    rest->size += raised ? by_axis : (fv)(0.0f);
    const fv own = (raised ? (fv)(0.0f) : by_axis) + by_area * (1.0f - share * grown);
    out->w[k] = -own / w;
    rest->along[k] = by_area * (grown - 1.0f) * q * w * inverse_whitened;
  }
}

// Adds what is left to the gradients of the rotation and the mean.
void mean_footprint_gradient(const ViewGaussian* g,
                             const FootprintGradient* rest,
                             ViewGradient* out) {
#pragma unroll
  for (int k = 0; k < 3; ++k) {
#pragma unroll
    for (int j = 0; j < 3; ++j) {
      out->axis[3 * k + j] += rest->along[k] * g->m[j];
      out->m[j] += rest->along[k] * g->axis[3 * k + j];
    }
  }
#if LENS == RS_LENS_AROUND
  const fv distance = view_distance(g);
#pragma unroll
  for (int j = 0; j < 3; ++j) out->m[j] += rest->size * g->m[j] / (distance * distance);
#else
  out->m[2] += g->m[2] > 0.0f ? rest->size / g->m[2] : (fv)(0.0f);
#endif
}
#endif

void parameter_gradient(const ViewGaussian* g,
                        const ViewGradient* view,
                        const fv opacity,
                        const iv touched,
                        const RsCamera* camera,
                        ParameterGradient* out) {
  const fv zero = (fv)(0.0f);
  const float* V = camera->rotation;
  fv gR[9];
#pragma unroll
  for (int j = 0; j < 3; ++j) {
    const fv mean = V[j] * view->m[0] + V[3 + j] * view->m[1] + V[6 + j] * view->m[2];
    out->mean[j] = touched ? mean + out->mean[j] : zero;
#pragma unroll
    for (int k = 0; k < 3; ++k) {
      gR[3 * j + k] = V[j] * view->axis[3 * k] + V[3 + j] * view->axis[3 * k + 1] +
                      V[6 + j] * view->axis[3 * k + 2];
    }
  }
  fv gq[4];
  rotation_gradient(g->q, gR, gq);
  const fv along = gq[0] * g->q[0] + gq[1] * g->q[1] + gq[2] * g->q[2] + gq[3] * g->q[3];
#pragma unroll
  for (int j = 0; j < 4; ++j) {
    const fv value = (gq[j] - g->q[j] * along) / g->q_norm;
    out->quaternion[j] = touched ? value : zero;
  }
  const fv thinnest = thinnest_axis(view_distance(g));
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const iv moves = touched & (g->raw_scale[k] >= thinnest);
    const fv value = -view->w[k] * g->w[k] * rs_scale_log_derivative(g->raw_scale[k]);
    out->scale[k] = moves ? value : zero;
  }
  // 1 - opacity has no digits left where a Gaussian is nearly opaque.
  out->opacity = touched ? opacity * g->opacity * rs_sigmoid(-g->logit) : zero;
}

// Contribution to the camera's gradient: centre in world axes, left rotation vector in camera axes.
// The mean enters only through m - c, so the centre takes the opposite of its gradient.
void pose_gradient(
    const ViewGaussian* g, const ViewGradient* view, const fv* mean, const iv touched, fv* out) {
  fv rotation[3];
  rotation[0] = g->m[1] * view->m[2] - g->m[2] * view->m[1];
  rotation[1] = g->m[2] * view->m[0] - g->m[0] * view->m[2];
  rotation[2] = g->m[0] * view->m[1] - g->m[1] * view->m[0];
#pragma unroll
  for (int k = 0; k < 3; ++k) {
    const fv* r = g->axis + 3 * k;
    const fv* gr = view->axis + 3 * k;
    rotation[0] += r[1] * gr[2] - r[2] * gr[1];
    rotation[1] += r[2] * gr[0] - r[0] * gr[2];
    rotation[2] += r[0] * gr[1] - r[1] * gr[0];
  }
#pragma unroll
  for (int j = 0; j < 3; ++j) {
    out[j] = -mean[j];
    out[3 + j] = touched ? rotation[j] : (fv)(0.0f);
  }
}

#endif
