// SPDX-License-Identifier: Apache-2.0
// prepare_view: everything that tracing one camera view reads of one Gaussian, in one pass: the
// 64-byte line (camera line or general form, docs/model.md) and the record that culls it (box of
// the exact outline, least depth). One work-item per Gaussian, any local size.
#include "shared/sh.h"
#include "trace/view.h"

#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

// Slack for float rounding in the closed-form outline, in units of the tangent coordinate.
#define RS_OUTLINE_SLACK 2e-6f

void write_projective(const ViewGaussian* g, __private float* v) {
  const float mx = g->m[0], my = g->m[1], mz = g->m[2];
  const float iz = 1.0f / mz;
  float a = 0, b = 0, c = 0, d0 = 0, ex = 0, ey = 0, c00 = 0, c01 = 0, c11 = 0;
  for (int k = 0; k < 3; ++k) {
    const float rx = g->axis[3 * k], ry = g->axis[3 * k + 1], rz = g->axis[3 * k + 2];
    // o' x M_j by the cofactor identity (Ma) x (Mb) = det(M) M^-T (a x b): no cancellation.
    const float P = g->w[(k + 1) % 3] * g->w[(k + 2) % 3];
    const float A = (ry * mz - rz * my) * P;
    const float B = (rz * mx - rx * mz) * P;
    a += A * A;
    b += A * B;
    c += B * B;
    const float w = g->w[k];
    const float q = (rx * mx + ry * my + rz * mz) * w;
    d0 += q * q;
    ex += q * rx * w;
    ey += q * ry * w;
    c00 += rx * rx * w * w;
    c01 += rx * ry * w * w;
    c11 += ry * ry * w * w;
  }
  v[0] = mx * iz;
  v[1] = my * iz;
  v[2] = mz;
  v[3] = a;
  v[4] = b;
  v[5] = c;
  v[6] = d0 * iz * iz;
  v[7] = ex * iz;
  v[8] = ey * iz;
  v[9] = c00;
  v[10] = c01;
  v[11] = c11;
}

void write_general(const ViewGaussian* g, __private float* v) {
  for (int k = 0; k < 3; ++k) {
    float o = 0;
    for (int j = 0; j < 3; ++j) {
      v[3 * k + j] = g->axis[3 * k + j] * g->w[k];
      o -= g->axis[3 * k + j] * g->m[j];
    }
    v[9 + k] = o * g->w[k];
  }
}

// Interval of X = x/z (axis 0) or Y = y/z (axis 1) that the ellipsoid covers; it must lie in front
// of the camera plane. The planes through the camera that touch it: xi^2 (m_z^2 - Q S_zz) + 2 xi Q
// q - Q p = 0 about x0.
float2 outline_interval(const ViewGaussian* g, int axis, float Q) {
  const float x0 = g->m[axis] / g->m[2];
  float p = 0, q = 0, szz = 0;
  for (int k = 0; k < 3; ++k) {
    const float s2 = g->scale[k] * g->scale[k];
    const float rz = g->axis[3 * k + 2];
    const float n = g->axis[3 * k + axis] - x0 * rz;
    p += s2 * n * n;
    q += s2 * n * rz;
    szz += s2 * rz * rz;
  }
  const float lead = g->m[2] * g->m[2] - Q * szz;
  const float root = sqrt(Q * Q * q * q + lead * Q * p);
  const float slack = RS_OUTLINE_SLACK * (1.0f + fabs(x0)) + 1e-4f * root / lead;
  return (float2)(x0 + (-Q * q - root) / lead - slack, x0 + (-Q * q + root) / lead + slack);
}

// Lower bound of the depth at which a ray passes its peak inside the ellipsoid. In whitened
// coordinates about the mean, peaks lie on the sphere over [mean, camera] (Thales), so their part
// along the direction to the camera is in [0, Q / |o'|]; depth falls by m_z / |o'| per unit of it,
// and by the root of what is left of S_zz per unit across.
float least_peak(const ViewGaussian* g, float Q, float szz, float whitened) {
  const float along2 = g->m[2] * g->m[2] / whitened;
  const float across2 = fmax(szz - along2, 0.0f) + 1e-5f * szz;
  const float nearer = fmax(g->m[2], 0.0f) * fmin(Q / whitened, sqrt(Q / whitened));
  return g->m[2] - nearer - sqrt(Q * across2);
}

__kernel void prepare_view(const uint count,
                           __global const float* restrict means,
                           __global const float* restrict quaternions,
                           __global const float* restrict scales,
                           __global const float* restrict opacities,
                           __global const float* restrict sh,
                           const int sh_coefficients,
                           const int active_degree,
                           const RsCamera camera_argument,
                           const float quantile,
                           const float4 window,
                           __global RsLine* restrict lines,
                           __global RsViewBounds* restrict bounds) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsCamera camera = camera_argument;
  RsViewBounds box;
  box.x0 = box.y0 = box.x1 = box.y1 = 0.0f;
  box.depth = 0.0f;
  box.quantile = 0.0f;
  box.kind = RS_LINE_HIDDEN;
  box.padding = 0;

  ViewGaussian g;
  const bool finite = load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  const float Q = effective_quantile(quantile, g.opacity);
  float szz = 0, whitened = 0;
  for (int k = 0; k < 3; ++k) {
    const float along = g.axis[3 * k + 2] * g.scale[k];
    szz += along * along;
    const float o =
        (g.axis[3 * k] * g.m[0] + g.axis[3 * k + 1] * g.m[1] + g.axis[3 * k + 2] * g.m[2]) * g.w[k];
    whitened += o * o;
  }
  const float reach = sqrt(fmax(Q, 0.0f) * szz) * 1.00001f;
  bool visible = finite && Q > 0.0f && g.opacity > 0.0f && g.m[2] + reach > 0.0f;
  visible = visible && !(camera.near_depth > 0.0f && g.m[2] < camera.near_depth);
#if !PEAK_ORDER
  visible = visible && whitened > Q;  // an origin inside misses
#endif
  if (visible) {
    box.quantile = Q;
    float least = g.m[2] - reach;
#if PEAK_ORDER
    least = fmax(least, least_peak(&g, Q, szz, whitened));
#endif
    box.depth = fmax(least * 0.99999f, 0.0f);
    box.kind = is_projective(&g) ? RS_LINE_PROJECTIVE : RS_LINE_GENERAL;
    if (g.m[2] > reach * 1.0001f) {
      const float2 x = outline_interval(&g, 0, Q);
      const float2 y = outline_interval(&g, 1, Q);
      box.x0 = x.x;
      box.x1 = x.y;
      box.y0 = y.x;
      box.y1 = y.y;
      if (!(x.x <= window.z && x.y >= window.x && y.x <= window.w && y.y >= window.y))
        box.kind = RS_LINE_HIDDEN;
    } else {
      // It reaches through the camera plane: its outline may be unbounded.
      box.x0 = box.y0 = -INFINITY;
      box.x1 = box.y1 = INFINITY;
    }
  }
  bounds[i] = box;
  if (box.kind == RS_LINE_HIDDEN) return;

  float v[16];
  if (box.kind == RS_LINE_PROJECTIVE) {
    write_projective(&g, v);
  } else {
    write_general(&g, v);
  }
  v[12] = g.opacity;
  const float dx = means[3 * i] - camera.center[0];
  const float dy = means[3 * i + 1] - camera.center[1];
  const float dz = means[3 * i + 2] - camera.center[2];
  const float inverse = rsqrt(fmax(dx * dx + dy * dy + dz * dz, 1e-30f));
  float basis[25];
  rs_sh_basis(active_degree, dx * inverse, dy * inverse, dz * inverse, basis);
  const int active = (active_degree + 1) * (active_degree + 1);
  float r = 0.5f, gr = 0.5f, b = 0.5f;
  __global const float* c = sh + (size_t)i * 3 * sh_coefficients;
  for (int k = 0; k < active; ++k) {
    r += basis[k] * c[3 * k];
    gr += basis[k] * c[3 * k + 1];
    b += basis[k] * c[3 * k + 2];
  }
  v[13] = fmax(r, 0.0f);
  v[14] = fmax(gr, 0.0f);
  v[15] = fmax(b, 0.0f);
  for (int k = 0; k < 16; ++k) lines[i].v[k] = v[k];
}
