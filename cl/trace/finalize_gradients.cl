// SPDX-License-Identifier: Apache-2.0
// finalize_gradients: carries the gradient of a Gaussian's line on to its parameters, once per
// Gaussian and view after all rays are summed: mean, unnormalised quaternion, scale parameter under
// either activation, opacity logit, SH coefficients (with the direction's dependence on the mean),
// and the screen statistics that density control reads. Sums the private copies of the line
// gradients in a fixed order. One work-item per Gaussian. With POSE, per-Gaussian contributions to
// the camera's gradient are written too (6 floats each: centre in world axes, left rotation vector
// in camera axes).
#include "shared/sh.h"
#include "trace/view.h"

#ifndef POSE
#define POSE 0
#endif

typedef struct {
  float m[3];
  float axis[9];
  float w[3];
} ViewGradient;

void projective_gradient(const ViewGaussian* g, const float* v, ViewGradient* out) {
  const float mx = g->m[0], my = g->m[1], mz = g->m[2];
  const float iz = 1.0f / mz;
  const float x0 = mx * iz, y0 = my * iz;
  float ex = 0, ey = 0, d0 = 0;
  float P[3], gP[3];
  for (int k = 0; k < 3; ++k) P[k] = g->w[(k + 1) % 3] * g->w[(k + 2) % 3];
  for (int k = 0; k < 3; ++k) {
    const float rx = g->axis[3 * k], ry = g->axis[3 * k + 1], rz = g->axis[3 * k + 2];
    const float w = g->w[k];
    const float A = ry * mz - rz * my;
    const float B = rz * mx - rx * mz;
    const float gA = P[k] * P[k] * (2.0f * v[3] * A + v[4] * B);
    const float gB = P[k] * P[k] * (2.0f * v[5] * B + v[4] * A);
    gP[k] = 2.0f * P[k] * (v[3] * A * A + v[4] * A * B + v[5] * B * B);
    const float along = rx * mx + ry * my + rz * mz;
    const float q = along * w;
    d0 += q * q;
    ex += q * rx * w;
    ey += q * ry * w;
    const float ge = v[7] * rx + v[8] * ry;
    const float gq = 2.0f * v[6] * q * iz * iz + ge * w * iz;
    out->w[k] =
        ge * q * iz + 2.0f * w * (v[9] * rx * rx + v[10] * rx * ry + v[11] * ry * ry) + gq * along;
    out->axis[3 * k] =
        v[7] * q * w * iz + w * w * (2.0f * v[9] * rx + v[10] * ry) + gq * w * mx - gB * mz;
    out->axis[3 * k + 1] =
        v[8] * q * w * iz + w * w * (2.0f * v[11] * ry + v[10] * rx) + gq * w * my + gA * mz;
    out->axis[3 * k + 2] = gq * w * mz - gA * my + gB * mx;
    out->m[0] += gq * w * rx + gB * rz;
    out->m[1] += gq * w * ry - gA * rz;
    out->m[2] += gq * w * rz + gA * ry - gB * rx;
  }
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    out->w[i] += gP[k] * g->w[j];
    out->w[j] += gP[k] * g->w[i];
  }
  out->m[0] += v[0] * iz;
  out->m[1] += v[1] * iz;
  out->m[2] -= (v[0] * x0 + v[1] * y0) * iz + 2.0f * v[6] * d0 * iz * iz * iz +
               (v[7] * ex + v[8] * ey) * iz * iz;
}

void general_gradient(const ViewGaussian* g, const float* v, ViewGradient* out) {
  for (int k = 0; k < 3; ++k) {
    const float w = g->w[k];
    const float go = v[9 + k];
    float along = 0, gw = 0;
    for (int j = 0; j < 3; ++j) {
      const float r = g->axis[3 * k + j];
      along += r * g->m[j];
      gw += v[3 * k + j] * r;
      out->axis[3 * k + j] = (v[3 * k + j] - go * g->m[j]) * w;
      out->m[j] -= go * w * r;
    }
    out->w[k] = gw - go * along;
  }
}

__kernel void finalize_gradients(const uint count,
                                 const uint copies,
                                 __global const float16* restrict line_gradients,
                                 __global const RsViewBounds* restrict bounds,
                                 __global const RsLine* restrict lines,
                                 __global const float* restrict means,
                                 __global const float* restrict quaternions,
                                 __global const float* restrict scales,
                                 __global const float* restrict opacities,
                                 __global const float* restrict sh,
                                 const int sh_coefficients,
                                 const int active_degree,
                                 const RsCamera camera_argument,
                                 const float screen_x,
                                 const float screen_y,
                                 __global float* restrict g_means,
                                 __global float* restrict g_quaternions,
                                 __global float* restrict g_scales,
                                 __global float* restrict g_opacities,
                                 __global float* restrict g_sh,
                                 __global float* restrict screen,
                                 __global float* restrict pose) {
#if !POSE
  (void)pose;
#endif
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsCamera camera = camera_argument;
  __global float* gsh = g_sh + (size_t)i * 3 * sh_coefficients;
  float16 sum = (float16)(0.0f);
  const int kind = bounds[i].kind;
  if (kind != RS_LINE_HIDDEN) {
    for (uint c = 0; c < copies; ++c) sum += line_gradients[(size_t)c * count + i];
  }
  float v[16];
  vstore16(sum, 0, v);
  float touched = 0.0f;
  for (int k = 0; k < 16; ++k) touched += fabs(v[k]);
  if (touched == 0.0f) {
    vstore3((float3)(0.0f), i, g_means);
    vstore4((float4)(0.0f), i, g_quaternions);
    vstore3((float3)(0.0f), i, g_scales);
    g_opacities[i] = 0.0f;
    for (int k = 0; k < 3 * sh_coefficients; ++k) gsh[k] = 0.0f;
    vstore3((float3)(0.0f), i, screen);
#if POSE
    for (int k = 0; k < 6; ++k) pose[6 * (size_t)i + k] = 0.0f;
#endif
    return;
  }

  ViewGaussian g;
  load_view_gaussian(i, means, quaternions, scales, opacities, &camera, &g);
  ViewGradient view;
  for (int k = 0; k < 3; ++k) view.m[k] = 0.0f;
  if (kind == RS_LINE_PROJECTIVE) {
    projective_gradient(&g, v, &view);
    vstore3((float3)(sqrt(v[0] * v[0] * screen_x * screen_x + v[1] * v[1] * screen_y * screen_y),
                     v[2], 1.0f),
            i, screen);
  } else {
    general_gradient(&g, v, &view);
    vstore3((float3)(0.0f, 0.0f, 1.0f), i, screen);
  }

  const float* V = camera.rotation;
  float mean[3], gR[9];
  for (int j = 0; j < 3; ++j) {
    mean[j] = V[j] * view.m[0] + V[3 + j] * view.m[1] + V[6 + j] * view.m[2];
    for (int k = 0; k < 3; ++k) {
      gR[3 * j + k] = V[j] * view.axis[3 * k] + V[3 + j] * view.axis[3 * k + 1] +
                      V[6 + j] * view.axis[3 * k + 2];
    }
  }
#if POSE
  float rotation[3];
  rotation[0] = g.m[1] * view.m[2] - g.m[2] * view.m[1];
  rotation[1] = g.m[2] * view.m[0] - g.m[0] * view.m[2];
  rotation[2] = g.m[0] * view.m[1] - g.m[1] * view.m[0];
  for (int k = 0; k < 3; ++k) {
    const float* r = g.axis + 3 * k;
    const float* gr = view.axis + 3 * k;
    rotation[0] += r[1] * gr[2] - r[2] * gr[1];
    rotation[1] += r[2] * gr[0] - r[0] * gr[2];
    rotation[2] += r[0] * gr[1] - r[1] * gr[0];
  }
#endif

  // Colour: max(0, .) passes nothing where it clamps. Direction n = (m - c) / |m - c|.
  const float dx = means[3 * i] - camera.center[0];
  const float dy = means[3 * i + 1] - camera.center[1];
  const float dz = means[3 * i + 2] - camera.center[2];
  const float inverse = rsqrt(fmax(dx * dx + dy * dy + dz * dz, 1e-30f));
  const float nx = dx * inverse, ny = dy * inverse, nz = dz * inverse;
  const float cr = lines[i].v[13] > 0.0f ? v[13] : 0.0f;
  const float cg = lines[i].v[14] > 0.0f ? v[14] : 0.0f;
  const float cb = lines[i].v[15] > 0.0f ? v[15] : 0.0f;
  float basis[25];
  rs_sh_basis(active_degree, nx, ny, nz, basis);
  const int active = (active_degree + 1) * (active_degree + 1);
  __global const float* coefficient = sh + (size_t)i * 3 * sh_coefficients;
  float gn[3] = {0.0f, 0.0f, 0.0f};
  for (int k = 0; k < active; ++k) {
    gsh[3 * k] = basis[k] * cr;
    gsh[3 * k + 1] = basis[k] * cg;
    gsh[3 * k + 2] = basis[k] * cb;
    const float along =
        coefficient[3 * k] * cr + coefficient[3 * k + 1] * cg + coefficient[3 * k + 2] * cb;
    if (k > 0) rs_sh_gradient(k, nx, ny, nz, along, gn);
  }
  for (int k = 3 * active; k < 3 * sh_coefficients; ++k) gsh[k] = 0.0f;
  const float radial = gn[0] * nx + gn[1] * ny + gn[2] * nz;
  mean[0] += (gn[0] - radial * nx) * inverse;
  mean[1] += (gn[1] - radial * ny) * inverse;
  mean[2] += (gn[2] - radial * nz) * inverse;
  vstore3((float3)(mean[0], mean[1], mean[2]), i, g_means);
#if POSE
  // The mean enters only through m - c, so the centre takes the opposite.
  for (int j = 0; j < 3; ++j) {
    pose[6 * (size_t)i + j] = -mean[j];
    pose[6 * (size_t)i + 3 + j] = rotation[j];
  }
#endif

  const float4 gq = rotation_gradient(g.q, gR);
  vstore4((gq - g.q * dot(gq, g.q)) / g.q_norm, i, g_quaternions);
  float gs[3];
  for (int k = 0; k < 3; ++k) {
    const bool floored = g.raw_scale[k] < g.scale[k];
    gs[k] = floored ? 0.0f : -view.w[k] * g.w[k] * scale_log_derivative(g.scale[k]);
  }
  vstore3((float3)(gs[0], gs[1], gs[2]), i, g_scales);
  g_opacities[i] = v[12] * g.opacity * (1.0f - g.opacity);
}
