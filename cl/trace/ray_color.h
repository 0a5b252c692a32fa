// SPDX-License-Identifier: Apache-2.0
// Colours of the Gaussians that an arbitrary ray meets.
#ifndef RS_TRACE_RAY_COLOR_H
#define RS_TRACE_RAY_COLOR_H

#include "primitives/prefetch.h"
#include "shared/color.h"
#include "shared/layout.h"
#include "shared/sh.h"
#include "trace/arguments.h"
#include "trace/ray_block.h"
#include "trace/ray_pending.h"

// What all rays of a launch share.
typedef struct {
  __global const uint* level_begin;  // first node of level l, from 1
  __global const fv* nodes;
  __global const fv* blocks;
  __global const float* sh;
  int levels;
  int sh_coefficients;
  int active_degree;
  int color_from_origin;
  float quantile;
  float min_transmittance;
  int max_hits;
  float4 near;  // of ray_meets_block()
} RayScene;

RayScene ray_scene(RS_TREE_ARGUMENTS, __global const float* restrict sh, const RsRayWalk* walk) {
  const RayScene scene = {level_begin,
                          nodes,
                          blocks,
                          sh,
                          levels,
                          walk->sh_coefficients,
                          walk->active_degree,
                          walk->color_from_origin,
                          walk->quantile,
                          walk->min_transmittance,
                          walk->max_hits,
                          vload4(0, walk->near)};
  return scene;
}

// The basis along the ray, for colours that do not come from its origin.
void basis_along_ray(const RayScene* scene, const RayData* ray, float* basis) {
  if (scene->active_degree == 0 || scene->color_from_origin) return;
  const float3 n = ray->d * rsqrt(fmax(dot(ray->d, ray->d), 1e-38f));
  rs_sh_basis(scene->active_degree, n.x, n.y, n.z, basis);
}

float4 hit_color(const RayScene* scene,
                 const RayData* ray,
                 const float* ray_basis,
                 const Pending* pending,
                 int entry) {
  const int degree = scene->active_degree;
  if (degree == 0) return pending->color[entry];
  const uint slot = pending->slot[entry];
  float own_basis[25];
  const float* basis = ray_basis;
  if (scene->color_from_origin) {
    __global const float* mean =
        (__global const float*)(scene->blocks + slot / PACKET * RS_BLOCK_VECTORS) + 6 * PACKET +
        slot % PACKET;
    const float3 v = (float3)(mean[0], mean[PACKET], mean[2 * PACKET]) - ray->o;
    const float3 n = v * rsqrt(fmax(dot(v, v), 1e-30f));
    rs_sh_basis(degree, n.x, n.y, n.z, own_basis);
    basis = own_basis;
  }
  __global const float* c = scene->sh + (size_t)pending->index[entry] * 3 * scene->sh_coefficients;
  const int active = (degree + 1) * (degree + 1);
  float3 even = (float3)(0.5f), odd = (float3)(0.0f);
  even += basis[0] * vload3(0, c);
  for (int k = 1; k < active; k += 2) odd += basis[k] * vload3(k, c);
  for (int k = 2; k < active; k += 2) even += basis[k] * vload3(k, c);
  return (float4)(fmin(fmax(even + odd, (float3)(0.0f)), (float3)(RS_MAX_COLOR)), 0.0f);
}

// Blending reads a Gaussian's coefficients long after its hit is found: time to fetch them.
void prefetch_color(const RayScene* scene, uint index) {
  if (scene->active_degree == 0) return;
  __global const float* c = scene->sh + (size_t)index * 3 * scene->sh_coefficients;
  const int active = 3 * (scene->active_degree + 1) * (scene->active_degree + 1);
  for (int k = 0; k < active; k += 16) RS_PREFETCH_READ(c + k);
  (void)c;
}

#endif
