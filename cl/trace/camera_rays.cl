// SPDX-License-Identifier: Apache-2.0
// Rays of a camera's pixels, row by row, for every camera model, with jitter and a thin lens.
// Launch of camera_rays: one work-item per ray, any group size. A pixel that sees nothing gets an
// empty ray (t_max < 0). Cost: a few dozen operations; models with distortion iterate.
// Models: Brown 1966 and Kannala and Brandt 2006, as in OpenCV; their polynomial
// is inverted by Newton's method kept inside a bracket, then the tangential terms in two
// dimensions.
#include "shared/layout.h"
#include "shared/random.h"

#ifndef CAMERA_MODEL
#define CAMERA_MODEL RS_CAMERA_PINHOLE
#endif

#define RS_RADIAL_STEPS 48
#define RS_TANGENTIAL_STEPS 8
#define RS_FAR 3.402823466e38f

float radial_image(const RsLensCamera* c, float r) {
  const float s = r * r;
  return r * (1.0f + s * (c->k1 + s * (c->k2 + s * (c->k3 + s * c->k4))));
}

float radial_slope(const RsLensCamera* c, float r) {
  const float s = r * r;
  return 1.0f + s * (3.0f * c->k1 + s * (5.0f * c->k2 + s * (7.0f * c->k3 + s * 9.0f * c->k4)));
}

// Radius or angle in [0, limit] whose image is nearest to `image`.
float invert_radial(const RsLensCamera* c, float image) {
  float low = 0.0f, high = c->limit;
  float r = fmin(image, c->limit);
  for (int i = 0; i < RS_RADIAL_STEPS; ++i) {
    const float residual = radial_image(c, r) - image;
    if (residual > 0.0f) {
      high = r;
    } else {
      low = r;
    }
    float next = r - residual / radial_slope(c, r);
    if (!(next >= low && next <= high)) next = 0.5f * (low + high);
    const bool done = fabs(next - r) <= 1e-7f * r;
    r = next;
    if (done) break;
  }
  return r;
}

float2 distorted(const RsLensCamera* c, float2 p) {
  const float s = dot(p, p);
  const float radial = 1.0f + s * (c->k1 + s * (c->k2 + s * c->k3));
  const float twice = 2.0f * p.x * p.y;
  return p * radial + (float2)(c->p1 * twice + c->p2 * (s + 2.0f * p.x * p.x),
                               c->p2 * twice + c->p1 * (s + 2.0f * p.y * p.y));
}

// The undistorted point of an OpenCV lens; false where there is none.
bool undistorted(const RsLensCamera* c, float2 target, float2* point) {
  const float image = length(target);
  // On the fold of the polynomial Newton's method in two dimensions could not leave.
  const bool tangential = c->p1 != 0.0f || c->p2 != 0.0f;
  const float r = fmin(invert_radial(c, image), tangential ? 0.999f * c->limit : c->limit);
  float2 p = image > 0.0f ? target * (r / image) : (float2)(0.0f);
  if (tangential) {
    for (int i = 0; i < RS_TANGENTIAL_STEPS; ++i) {
      const float2 residual = distorted(c, p) - target;
      const float s = dot(p, p);
      const float radial = 1.0f + s * (c->k1 + s * (c->k2 + s * c->k3));
      const float slope = 2.0f * (c->k1 + s * (2.0f * c->k2 + s * 3.0f * c->k3));
      const float mixed = slope * p.x * p.y + 2.0f * (c->p1 * p.x + c->p2 * p.y);
      const float xx = radial + slope * p.x * p.x + 2.0f * c->p1 * p.y + 6.0f * c->p2 * p.x;
      const float yy = radial + slope * p.y * p.y + 6.0f * c->p1 * p.y + 2.0f * c->p2 * p.x;
      p -= (float2)(yy * residual.x - mixed * residual.y, xx * residual.y - mixed * residual.x) /
           (xx * yy - mixed * mixed);
      if (dot(residual, residual) <= 1e-14f * (1.0f + image * image)) break;
    }
  }
  *point = p;
  const float2 residual = distorted(c, p) - target;
  return dot(residual, residual) <= 1e-10f * (1.0f + image * image) &&
         dot(p, p) <= c->limit * c->limit;
}

__kernel void camera_rays(const RsLensCamera camera,
                          const uint first_pixel,
                          const uint count,
                          __global float8* restrict rays) {
  const size_t id = get_global_id(0);
  if (id >= count) return;
  const uint pixel = first_pixel + (uint)id;
  const uint row = pixel / (uint)camera.width;
  const uint column = pixel - row * (uint)camera.width;
  float2 at = (float2)(0.5f);
  RsRandom4 random = {0.5f, 0.5f, 0.0f, 0.0f};
  if (camera.jitter) {
    random = rs_random4(camera.seed_lo, camera.seed_hi, pixel, camera.sample, 0);
    at = (float2)(random.x, random.y);
  }
#if CAMERA_MODEL != RS_CAMERA_EQUIRECTANGULAR
  // The pixel's column and the centre are subtracted first: both are exact to their last digit.
  const float2 p = (float2)((((float)column - camera.cx) + at.x) / camera.fx,
                            (((float)row - camera.cy) + at.y) / camera.fy);
#endif

  // In camera axes.
  float3 origin = (float3)(0.0f);
  float3 direction = (float3)(0.0f, 0.0f, 1.0f);
  bool valid = true;
#if CAMERA_MODEL == RS_CAMERA_PINHOLE
  direction = (float3)(p, 1.0f);
#elif CAMERA_MODEL == RS_CAMERA_OPENCV
  float2 point;
  valid = undistorted(&camera, p, &point);
  if (valid) direction = (float3)(point, 1.0f);
#elif CAMERA_MODEL == RS_CAMERA_FISHEYE
  const float image = length(p);
  valid = image <= camera.image_limit;
  if (valid) {
    const float angle = invert_radial(&camera, image);
    const float sine = image > 0.0f ? sin(angle) / image : 1.0f;
    direction = (float3)(sine * p, cos(angle));
  }
#elif CAMERA_MODEL == RS_CAMERA_EQUIRECTANGULAR
  // In half turns, which sinpi and cospi take without loss.
  const float longitude =
      2.0f * ((((float)column - 0.5f * (float)camera.width) + at.x) / (float)camera.width);
  const float latitude = (((float)row - 0.5f * (float)camera.height) + at.y) / (float)camera.height;
  const float across = cospi(latitude);
  direction = (float3)(sinpi(longitude) * across, sinpi(latitude), cospi(longitude) * across);
#elif CAMERA_MODEL == RS_CAMERA_ORTHOGRAPHIC
  origin = (float3)(p, 0.0f);
#else
#error "unknown CAMERA_MODEL"
#endif

#if CAMERA_MODEL != RS_CAMERA_ORTHOGRAPHIC
  if (camera.jitter && camera.aperture > 0.0f) {
#if CAMERA_MODEL == RS_CAMERA_PINHOLE || CAMERA_MODEL == RS_CAMERA_OPENCV
    const float3 focus = direction * (camera.focus_distance / direction.z);
#else
    const float3 focus = direction * (camera.focus_distance * rsqrt(dot(direction, direction)));
#endif
    const float radius = camera.aperture * sqrt(random.z);
    origin = (float3)(radius * cospi(2.0f * random.w), radius * sinpi(2.0f * random.w), 0.0f);
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
  rays[id] = (float8)(o, 0.0f, d / sqrt(dot(d, d)), valid ? RS_FAR : -1.0f);
}
