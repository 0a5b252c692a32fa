// SPDX-License-Identifier: Apache-2.0
// prepare_view: everything that tracing one camera view reads of one Gaussian, in one pass: the
// 64-byte line (camera line or general form, docs/model.md) and the record that culls it (box of
// the exact outline, least depth). One work-item per LANES Gaussians from number `begin` on; end -
// begin is a multiple of LANES. Work-groups of any size, of GROUP where that is not 0. Lines of
// hidden Gaussians are undefined.
#include "shared/color.h"
#include "trace/arguments.h"
#include "trace/staged_rows.h"
#include "trace/view.h"

#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

// Slack for float rounding in the closed-form outline, in units of the tangent coordinate.
#define RS_OUTLINE_SLACK 2e-6f

void write_projective(const ViewGaussian* g, fv* v) {
  const fv mx = g->m[0], my = g->m[1], mz = g->m[2];
  const fv iz = 1.0f / mz;
  fv a = 0, b = 0, origin2 = 0, ex = 0, ey = 0;
  for (int k = 0; k < 3; ++k) {
    const fv rx = g->axis[3 * k], ry = g->axis[3 * k + 1], rz = g->axis[3 * k + 2];
    // o' x M_j by the cofactor identity (Ma) x (Mb) = det(M) M^-T (a x b): no cancellation.
    const fv P = g->w[(k + 1) % 3] * g->w[(k + 2) % 3];
    const fv A = (ry * mz - rz * my) * P;
    const fv B = (rz * mx - rx * mz) * P;
    a += A * A;
    b += A * B;
    const fv w = g->w[k];
    const fv q = (rx * mx + ry * my + rz * mz) * w;
    origin2 += q * q;
    ex += q * rx * w;
    ey += q * ry * w;
  }
  v[0] = mx * iz;
  v[1] = my * iz;
  v[2] = mz;
  // p, q and r. q / p is the slope of a needle: no rounding of the root gets into it.
  const fv kappa = 1.0f / origin2;
  const fv across = sqrt(a);
  v[3] = mz * sqrt(kappa) * across;
  v[4] = b / a * v[3];
  v[5] = mz * g->w[0] * (g->w[1] * g->w[2] * mz / across);
  v[6] = mz * kappa * ex;
  v[7] = mz * kappa * ey;
  v[8] = kappa;
  v[9] = v[10] = v[11] = 0;
}

// Writes the general form in place of the projective one, in the lanes where `general` holds.
void write_general(const ViewGaussian* g, const iv general, fv* v) {
  for (int k = 0; k < 3; ++k) {
    fv o = 0;
    for (int j = 0; j < 3; ++j) {
      v[3 * k + j] = general ? g->axis[3 * k + j] * g->w[k] : v[3 * k + j];
      o -= g->axis[3 * k + j] * g->m[j];
    }
    v[9 + k] = general ? o * g->w[k] : v[9 + k];
  }
}

// Interval of X = x/z (axis 0) or Y = y/z (axis 1) that the ellipsoid covers; it must lie in front
// of the camera plane. The planes through the camera that touch it: xi^2 (m_z^2 - Q S_zz) + 2 xi Q
// q - Q p = 0 about x0.
void outline_interval(const ViewGaussian* g, const int axis, const fv Q, fv* lo, fv* hi) {
  const fv x0 = g->m[axis] / g->m[2];
  fv p = 0, q = 0, szz = 0;
  for (int k = 0; k < 3; ++k) {
    const fv s2 = g->scale[k] * g->scale[k];
    const fv rz = g->axis[3 * k + 2];
    const fv n = g->axis[3 * k + axis] - x0 * rz;
    p += s2 * n * n;
    q += s2 * n * rz;
    szz += s2 * rz * rz;
  }
  const fv lead = g->m[2] * g->m[2] - Q * szz;
  const fv root = sqrt(Q * Q * q * q + lead * Q * p);
  const fv slack = RS_OUTLINE_SLACK * (1.0f + fabs(x0)) + 1e-4f * root / lead;
  *lo = x0 + (-Q * q - root) / lead - slack;
  *hi = x0 + (-Q * q + root) / lead + slack;
}

// Lower bound of the depth at which a ray passes its peak inside the ellipsoid. In whitened
// coordinates about the mean, peaks lie on the sphere over [mean, camera] (Thales), so their part
// along the direction to the camera is in [0, Q / |o'|]; depth falls by m_z / |o'| per unit of it,
// and by the root of what is left of S_zz per unit across.
fv least_peak(const ViewGaussian* g, const fv Q, const fv szz, const fv whitened) {
  const fv along2 = g->m[2] * g->m[2] / whitened;
  const fv across2 = larger(szz - along2, (fv)(0.0f)) + 1e-5f * szz;
  const fv relative = Q / whitened;
  const fv nearer = larger(g->m[2], (fv)(0.0f)) * smaller(relative, sqrt(relative));
  return g->m[2] - nearer - sqrt(Q * across2);
}

#if GROUP
// Adds the terms of RS_STAGE floats of the SH coefficients from number `column` on.
void add_color(const int column,
               __global const float* sh,
               const float* basis,
               __local StagedRows* staged,
               float* sum) {
  const int count = min(3 * RS_SH_FUNCTIONS - column, RS_STAGE);
  if (count <= 0) return;
  stage_fetch(sh, 3 * SH_COEFFICIENTS, column, count, staged);
  const uint lane = get_local_id(0);
#pragma unroll
  for (int t = 0; t < RS_STAGE; ++t) {
    const int k = column + t;
    if (t < count) sum[k % 3] += basis[k / 3] * staged->rows[lane][t];
  }
}

// Writes the colours of the visible Gaussians; `sh` starts at the group's first.
void write_color(const ViewGaussian* g,
                 __global const float* sh,
                 __local StagedRows* staged,
                 float* color) {
  const float* d = g->offset;
  const float inverse = 1.0f / sqrt(fmax(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], 1e-30f));
  float basis[RS_SH_FUNCTIONS];
  rs_sh_basis(SH_DEGREE, d[0] * inverse, d[1] * inverse, d[2] * inverse, basis);
  float sum[3] = {0.5f, 0.5f, 0.5f};
  add_color(0, sh, basis, staged, sum);
  add_color(RS_STAGE, sh, basis, staged, sum);
  add_color(2 * RS_STAGE, sh, basis, staged, sum);
  add_color(3 * RS_STAGE, sh, basis, staged, sum);
  add_color(4 * RS_STAGE, sh, basis, staged, sum);
  add_color(5 * RS_STAGE, sh, basis, staged, sum);
  add_color(6 * RS_STAGE, sh, basis, staged, sum);
  for (int j = 0; j < 3; ++j) color[j] = fmin(fmax(sum[j], 0.0f), RS_MAX_COLOR);
}
#else
void write_color(const ViewGaussian* g, __global const float* sh, fv* color) {
  const fv* d = g->offset;
  const fv inverse = 1.0f / sqrt(larger(d[0] * d[0] + d[1] * d[1] + d[2] * d[2], (fv)(1e-30f)));
  fv basis[RS_SH_FUNCTIONS];
  rs_sh_basis(SH_DEGREE, d[0] * inverse, d[1] * inverse, d[2] * inverse, basis);
  fv c[3 * RS_SH_FUNCTIONS];
  load_columns(sh, 3 * SH_COEFFICIENTS, 3 * RS_SH_FUNCTIONS, c);
  fv r = 0.5f, green = 0.5f, b = 0.5f;
  for (int k = 0; k < RS_SH_FUNCTIONS; ++k) {
    r += basis[k] * c[3 * k];
    green += basis[k] * c[3 * k + 1];
    b += basis[k] * c[3 * k + 2];
  }
  const fv most = (fv)(RS_MAX_COLOR);
  color[0] = smaller(larger(r, (fv)(0.0f)), most);
  color[1] = smaller(larger(green, (fv)(0.0f)), most);
  color[2] = smaller(larger(b, (fv)(0.0f)), most);
}
#endif

#if GROUP
__attribute__((reqd_work_group_size(GROUP, 1, 1)))
#endif
__kernel void
prepare_view(const uint begin,
             const uint end,
             RS_GAUSSIAN_ARGUMENTS,
             const RsCamera camera_argument,
             const float quantile,
             const float4 window,
             __global RsLine* restrict lines,
             __global RsViewBounds* restrict bounds) {
#if GROUP
  __local StagedRows staged;
  const uint lane = get_local_id(0);
  const size_t first = begin + get_group_id(0) * GROUP;
  const bool exists = first + lane < end;
  const size_t i = exists ? first + lane : first;
#else
  const size_t i = begin + get_global_id(0) * (size_t)LANES;
  if (i >= end) return;
#endif
  const RsCamera camera = camera_argument;
  ViewGaussian g;
  const iv finite = load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
#if VIEW_FOOTPRINT
  FootprintShares shares;
  footprint_shares(&g, &shares);
  g.opacity *= footprint_dilution(&shares);
#endif
  const fv Q = effective_quantile(quantile, g.opacity);
  fv szz = 0, whitened = 0;
  for (int k = 0; k < 3; ++k) {
    const fv along = g.axis[3 * k + 2] * g.scale[k];
    szz += along * along;
    const fv o =
        (g.axis[3 * k] * g.m[0] + g.axis[3 * k + 1] * g.m[1] + g.axis[3 * k + 2] * g.m[2]) * g.w[k];
    whitened += o * o;
  }
  const fv reach = sqrt(larger(Q, (fv)(0.0f)) * szz) * 1.00001f;
#if LENS == RS_LENS_AROUND
  const iv far_enough =
      g.m[0] * g.m[0] + g.m[1] * g.m[1] + g.m[2] * g.m[2] >= camera.near_depth * camera.near_depth;
#else
  const iv far_enough = g.m[2] >= (camera.near_depth > 0.0f ? camera.near_depth : -INFINITY);
#endif
  iv visible = finite & (Q > 0.0f) & (g.opacity > 0.0f) & (g.m[2] + reach > 0.0f) & far_enough;
  fv least = g.m[2] - reach;
#if PEAK_ORDER
  least = larger(least_peak(&g, Q, szz, whitened), least);
#else
  visible = visible & (whitened > Q);  // an origin inside misses
#endif
  // What reaches through the camera plane may have an unbounded outline.
  const iv ahead = g.m[2] > reach * 1.0001f;
  fv x0, x1, y0, y1;
  outline_interval(&g, 0, Q, &x0, &x1);
  outline_interval(&g, 1, Q, &y0, &y1);
  visible = visible &
            (!ahead | ((x0 <= window.z) & (x1 >= window.x) & (y0 <= window.w) & (y1 >= window.y)));
  const iv projective = is_projective(&g);
  const iv kind = projective ? (iv)(RS_LINE_PROJECTIVE) : (iv)(RS_LINE_GENERAL);

  const fv infinite = (fv)(INFINITY);
  fv box[8];
  box[0] = ahead ? x0 : -infinite;
  box[1] = ahead ? y0 : -infinite;
  box[2] = ahead ? x1 : infinite;
  box[3] = ahead ? y1 : infinite;
  box[4] = larger(least * 0.99999f, (fv)(0.0f));
  box[5] = Q;
  box[6] = rs_as_float(visible ? kind : (iv)(RS_LINE_HIDDEN));
  box[7] = (fv)(0.0f);
#if GROUP
  for (int k = 0; k < 8; ++k) staged.rows[lane][k] = box[k];
  staged.present[lane] = exists;
  stage_store(&staged, 0, 8, (__global float*)(bounds + first), 8, 0, 0);
  staged.present[lane] = exists && visible;
#else
  store_records8(box, (__global float*)(bounds + i));
  if (!rs_any_of(visible)) return;
#endif

  fv v[16];
  write_projective(&g, v);
  if (rs_any_of(visible & !projective)) write_general(&g, !projective, v);
  v[12] = g.opacity;
#if GROUP
  for (int k = 0; k < 13; ++k) staged.rows[lane][k] = v[k];
  stage_store(&staged, 0, 13, (__global float*)(lines + first), 16, 0, 0);
  write_color(&g, sh + first * 3 * SH_COEFFICIENTS, &staged, v + 13);
  for (int k = 0; k < 3; ++k) staged.rows[lane][k] = v[13 + k];
  stage_store(&staged, 0, 3, (__global float*)(lines + first), 16, 13, 0);
#else
  write_color(&g, sh + i * 3 * SH_COEFFICIENTS, v + 13);
  store_columns(v, 16, (__global float*)(lines + i), 16);
#endif
}
