// SPDX-License-Identifier: Apache-2.0
// Rays and what they met, shared by kernels and host, under the rules of layout.h: what Ray and
// RayResult of include/raysplats/rays.hpp are there. Kernels read and write them by bvh/ray.h.
#ifndef RS_SHARED_RAY_LAYOUT_H
#define RS_SHARED_RAY_LAYOUT_H

#include "shared/compat.h"

typedef struct {
  rs_float origin[3];
  rs_float t_min;
  rs_float direction[3];
  rs_float t_max;  // less than t_min: an empty ray
} RsRay;
RS_STATIC_ASSERT_SIZE(RsRay, 32);

// The cone of a ray whose direction has unit length (Amanatides 1984): at t it meets no Gaussian
// thinner than width + spread t, a share of what a pixel sees there (trace/ray_cone.h).
typedef struct {
  rs_float width;
  rs_float spread;
} RsCone;
RS_STATIC_ASSERT_SIZE(RsCone, 8);

typedef struct {
  rs_float color[3];
  rs_float alpha;
  rs_float expected_depth;
  rs_float median_depth;
  rs_uint hits;  // or, of builds with LEADING, the Gaussian that leads them (trace/ray_tracer.cl)
  rs_uint capped;
} RsRayResult;
RS_STATIC_ASSERT_SIZE(RsRayResult, 32);

#endif
