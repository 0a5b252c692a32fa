// SPDX-License-Identifier: Apache-2.0
// Rays through the centres of a camera's pixels, row by row, for every camera model (lens.h), with
// a thin lens. Launch of camera_rays: one work-item per ray, any group size. A pixel that sees
// nothing gets an empty ray (t_max < 0). Cost: a few dozen operations; models with distortion
// iterate.
#include "bvh/ray.h"
#include "shared/random.h"
#include "trace/lens.h"

__kernel void camera_rays(const RsLensCamera camera,
                          const uint first_pixel,
                          const uint count,
                          __global RsRay* restrict rays) {
  const size_t id = get_global_id(0);
  if (id >= count) return;
  const uint pixel = first_pixel + (uint)id;
  const uint row = pixel / (uint)camera.width;
  const uint column = pixel - row * (uint)camera.width;
  const float2 at = (float2)(0.5f);
  // The ray in camera axes.
  float3 origin = (float3)(0.0f);
  float3 direction = (float3)(0.0f, 0.0f, 1.0f);
#if CAMERA_MODEL == RS_CAMERA_ORTHOGRAPHIC
  const bool valid = true;
  origin = (float3)(image_point(&camera, (float)column, (float)row, at), 0.0f);
#else
  const bool valid = lens_direction(&camera, (float)column, (float)row, at, &direction);
#endif

#if CAMERA_MODEL != RS_CAMERA_ORTHOGRAPHIC
  if (camera.aperture > 0.0f) {
    const RsRandom4 random = rs_random4(camera.seed_lo, camera.seed_hi, pixel, camera.sample, 0);
#if CAMERA_MODEL == RS_CAMERA_PINHOLE || CAMERA_MODEL == RS_CAMERA_OPENCV
    const float3 focus = direction * (camera.focus_distance / direction.z);
#else
    const float3 focus = direction * (camera.focus_distance * rsqrt(dot(direction, direction)));
#endif
    const float radius = camera.aperture * sqrt(random.x);
    origin = (float3)(radius * cospi(2.0f * random.y), radius * sinpi(2.0f * random.y), 0.0f);
    direction = focus - origin;
  }
#endif

  const float* m = camera.rotation;
  const float3 right = (float3)(m[0], m[1], m[2]);
  const float3 down = (float3)(m[3], m[4], m[5]);
  const float3 forward = (float3)(m[6], m[7], m[8]);
  const float3 o = (float3)(camera.center[0], camera.center[1], camera.center[2]) +
                   origin.x * right + origin.y * down;
  const float3 d = direction.x * right + direction.y * down + direction.z * forward;
  const Ray ray = {o, d / sqrt(dot(d, d)), 0.0f, valid ? FLT_MAX : -1.0f};
  store_ray(ray, rays, id);
}

// The cones of a camera's rays, which at a depth of 1 along `axis` (depth_cosine), or at a distance
// of 1 where it is zero, have the width `footprint`; of parallel rays everywhere.
__kernel void camera_cones(const uint count,
                           const float4 axis,
                           const float footprint,
                           __global const RsRay* restrict rays,
                           __global RsCone* restrict cones) {
  const uint i = get_global_id(0);
  if (i >= count) return;
#if CAMERA_MODEL == RS_CAMERA_ORTHOGRAPHIC
  const RsCone cone = {footprint, 0.0f};
#else
  const RsCone cone = {0.0f, footprint * depth_cosine(axis, load_ray(rays, i).direction)};
#endif
  cones[i] = cone;
}
