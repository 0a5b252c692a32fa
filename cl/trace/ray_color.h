// SPDX-License-Identifier: Apache-2.0
// Colours of the Gaussians that an arbitrary ray meets.
#ifndef RS_TRACE_RAY_COLOR_H
#define RS_TRACE_RAY_COLOR_H

#include "parallel/prefetch.h"
#include "shared/color.h"
#include "shared/layout.h"
#include "shared/sh.h"
#include "trace/arguments.h"
#include "trace/ray_block.h"

// Hits that a ray keeps on GPUs (ray_nearest.h); 0 = all of a walk, in private memory.
#ifndef KEPT
#define KEPT 0
#endif
#if KEPT
#include "trace/ray_nearest.h"
#else
#include "trace/ray_pending.h"
#endif

// What all rays of a launch share.
typedef struct {
  RayTree tree;
  __global const float* sh;
  int sh_coefficients;
  int active_degree;
  int color_from_origin;
  float quantile;
  float min_transmittance;
  float4 near;  // of ray_meets_block()
#if KEPT
  __local HitMemory* memory;
#endif
} RayScene;

RS_INLINE RayScene ray_scene(RS_TREE_ARGUMENTS,
                             __global const float* restrict sh,
                             const RsRayWalk* walk) {
  RayScene scene = {{levels, level_begin, nodes, blocks},
                    sh,
                    walk->sh_coefficients,
                    walk->active_degree,
                    walk->color_from_origin,
                    walk->quantile,
                    walk->min_transmittance,
                    (float4)(walk->near[0], walk->near[1], walk->near[2], walk->near[3])};
  return scene;
}

#if KEPT

// On GPUs the values of the functions are computed anew at every hit, which costs less than to keep
// them during the walk, and are as many as the degree has, which is known when this is compiled.
// Loops over them are not unrolled: all coefficients at once would fill the registers.
#ifndef SH_DEGREE
#define SH_DEGREE 0
#endif
#define RS_COLOR_FUNCTIONS ((SH_DEGREE + 1) * (SH_DEGREE + 1))

RS_INLINE void basis_along_ray(const RayScene* scene, const RayData* ray, float* basis) {
  (void)scene;
  (void)ray;
  (void)basis;
}

// Unit direction of the colour of hit k from the nearest, and one over the length it had.
RS_INLINE float4 color_direction(const RayScene* scene,
                                 const RayData* ray,
                                 const Pending* pending,
                                 const int k) {
  float3 v = ray->d;
  if (scene->color_from_origin) {
    const uint slot = pending_slot(pending, k);
    v = block_mean(scene->tree.blocks + slot / LANES * RS_BLOCK_VECTORS, slot % LANES) - ray->o;
  }
  const float inverse = rsqrt(fmax(dot(v, v), 1e-38f));
  return (float4)(v * inverse, inverse);
}

// The functions in the direction of hit k from the nearest, and the colour that they give.
RS_INLINE void hit_basis(
    const RayScene* scene, const RayData* ray, const Pending* pending, const int k, float* basis) {
  const float4 n = color_direction(scene, ray, pending, k);
  rs_sh_basis(SH_DEGREE, n.x, n.y, n.z, basis);
}

RS_INLINE float4 basis_color(const RayScene* scene,
                             const float* basis,
                             const Pending* pending,
                             const int k) {
  __global const fv* blocks = scene->tree.blocks;
#if SH_DEGREE == 0
  (void)basis;
  return pending_color(blocks, pending, k);
#else
  __global const float* c =
      scene->sh + (size_t)pending_index(blocks, pending, k) * 3 * scene->sh_coefficients;
  float3 color = (float3)(0.5f);
#pragma unroll 1
  for (int j = 0; j < RS_COLOR_FUNCTIONS; ++j) color += basis[j] * vload3(j, c);
  return (float4)(fmin(fmax(color, (float3)(0.0f)), (float3)(RS_MAX_COLOR)), 0.0f);
#endif
}

RS_INLINE float4 hit_color(const RayScene* scene,
                           const RayData* ray,
                           const float* ray_basis,
                           const Pending* pending,
                           const int k) {
  (void)ray_basis;
  float basis[RS_COLOR_FUNCTIONS];
  hit_basis(scene, ray, pending, k, basis);
  return basis_color(scene, basis, pending, k);
}

#else

// The basis along the ray, for colours that do not come from its origin.
RS_INLINE void basis_along_ray(const RayScene* scene, const RayData* ray, float* basis) {
  if (scene->active_degree == 0 || scene->color_from_origin) return;
  const float3 n = ray->d * rsqrt(fmax(dot(ray->d, ray->d), 1e-38f));
  rs_sh_basis(scene->active_degree, n.x, n.y, n.z, basis);
}

// The colour of the k-th nearest hit.
RS_INLINE float4 hit_color(const RayScene* scene,
                           const RayData* ray,
                           const float* ray_basis,
                           const Pending* pending,
                           const int k) {
  const int degree = scene->active_degree;
  __global const fv* blocks = scene->tree.blocks;
  if (degree == 0) return pending_color(blocks, pending, k);
  const uint slot = pending_slot(pending, k);
  float own_basis[25];
  const float* basis = ray_basis;
  if (scene->color_from_origin) {
    const float3 v = block_mean(blocks + slot / LANES * RS_BLOCK_VECTORS, slot % LANES) - ray->o;
    const float3 n = v * rsqrt(fmax(dot(v, v), 1e-30f));
    rs_sh_basis(degree, n.x, n.y, n.z, own_basis);
    basis = own_basis;
  }
  __global const float* c =
      scene->sh + (size_t)pending_index(blocks, pending, k) * 3 * scene->sh_coefficients;
  const int active = (degree + 1) * (degree + 1);
  float3 even = (float3)(0.5f), odd = (float3)(0.0f);
  even += basis[0] * vload3(0, c);
  for (int j = 1; j < active; j += 2) odd += basis[j] * vload3(j, c);
  for (int j = 2; j < active; j += 2) even += basis[j] * vload3(j, c);
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

#endif
