// SPDX-License-Identifier: Apache-2.0
// Rays and what they met, in registers. Records are read and written as one vector: its alignment
// tells compilers what that of a structure of floats does not, and a record stays one access.
#ifndef RS_BVH_RAY_H
#define RS_BVH_RAY_H

#include "shared/ray_layout.h"

#ifndef TRAIL
#define TRAIL 0  // of tree_walk.h
#endif
// What is not inlined passes its structures through private memory, which lies far away on GPUs.
// (RS_CALLS: Oclgrind does not know what LLVM leaves of structures that are returned inline.)
#if TRAIL && !defined(RS_CALLS)
#define RS_INLINE __attribute__((always_inline))
#else
#define RS_INLINE
#endif

typedef struct {
  float3 origin, direction;
  float t_min, t_max;
} Ray;

RS_INLINE Ray load_ray(__global const RsRay* rays, const size_t i) {
  const float8 words = ((__global const float8*)rays)[i];
  const Ray ray = {words.s012, words.s456, words.s3, words.s7};
  return ray;
}

RS_INLINE void store_ray(const Ray ray, __global RsRay* rays, const size_t i) {
  ((__global float8*)rays)[i] = (float8)(ray.origin, ray.t_min, ray.direction, ray.t_max);
}

// The cone of a ray that goes on from t in another direction.
RS_INLINE RsCone cone_behind(const RsCone cone, const float t) {
  const RsCone next = {cone.width + cone.spread * t, cone.spread};
  return next;
}

// What a length along a ray becomes along `axis`; along the ray itself where the axis is zero.
RS_INLINE float depth_cosine(const float4 axis, const float3 direction) {
  return any(axis != 0.0f) ? dot(axis.xyz, direction) : 1.0f;
}

typedef struct {
  float3 color;
  float alpha, expected_depth, median_depth;
  uint hits, capped;
} RayResult;

RS_INLINE RayResult load_result(__global const RsRayResult* results, const size_t i) {
  const float8 words = ((__global const float8*)results)[i];
  const RayResult result = {words.s012, words.s3,          words.s4,
                            words.s5,   as_uint(words.s6), as_uint(words.s7)};
  return result;
}

RS_INLINE void store_result(const RayResult result, __global RsRayResult* results, const size_t i) {
  ((__global float8*)results)[i] =
      (float8)(result.color, result.alpha, result.expected_depth, result.median_depth,
               as_float(result.hits), as_float(result.capped));
}

#endif
