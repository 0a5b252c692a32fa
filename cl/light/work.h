// SPDX-License-Identifier: Apache-2.0
// What tracing of light must at least do, as in trace/work.h. Rays that meet Gaussians cost their
// hits on top, which are not counted here.
#ifndef RS_LIGHT_WORK_H
#define RS_LIGHT_WORK_H

// Per ray to a surface: ray 32 and one triangle 40 read, hit 16 written.
#define RS_WORK_SURFACE_RAY_BYTES 88
// One triangle: shear 27, edge functions 21, depth and weights 12.
#define RS_WORK_SURFACE_RAY_FLOPS 60
// Per ray of a path: the above, and path 48, surface 80, Gaussians' result 32 and gain 16 written
// and read, next path and ray 80 written.
#define RS_WORK_PATH_BYTES 520
// Per shadow ray: ray 32 written and read twice, both answers 36 written and read, light 32.
#define RS_WORK_SHADOW_RAY_BYTES 200

#endif
