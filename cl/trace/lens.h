// SPDX-License-Identifier: Apache-2.0
// Directions of a camera's pixels in camera axes, for every central camera model.
// Models: Brown 1966 and Kannala and Brandt 2006, as in OpenCV; their polynomial is inverted by
// Newton's method kept inside a bracket, then the tangential terms in two dimensions.
#ifndef RS_TRACE_LENS_H
#define RS_TRACE_LENS_H

#include "shared/layout.h"

#ifndef CAMERA_MODEL
#define CAMERA_MODEL RS_CAMERA_PINHOLE
#endif

#define RS_RADIAL_STEPS 48
#define RS_TANGENTIAL_STEPS 8

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

// The point `at` (0 to 1 each) of a pixel in normalised image coordinates. The pixel's column and
// the centre are subtracted first: both are exact to their last digit.
float2 image_point(const RsLensCamera* c, const float column, const float row, const float2 at) {
  return (float2)(((column - c->cx) + at.x) / c->fx, ((row - c->cy) + at.y) / c->fy);
}

#if CAMERA_MODEL != RS_CAMERA_ORTHOGRAPHIC
// The direction through the point `at` of a pixel, of any length; false where the pixel sees
// nothing.
bool lens_direction(const RsLensCamera* c,
                    const float column,
                    const float row,
                    const float2 at,
                    float3* direction) {
#if CAMERA_MODEL == RS_CAMERA_PINHOLE
  *direction = (float3)(image_point(c, column, row, at), 1.0f);
  return true;
#elif CAMERA_MODEL == RS_CAMERA_OPENCV
  float2 point;
  const bool valid = undistorted(c, image_point(c, column, row, at), &point);
  if (valid) *direction = (float3)(point, 1.0f);
  return valid;
#elif CAMERA_MODEL == RS_CAMERA_FISHEYE
  const float2 p = image_point(c, column, row, at);
  const float image = length(p);
  if (!(image <= c->image_limit)) return false;
  const float angle = invert_radial(c, image);
  const float sine = image > 0.0f ? sin(angle) / image : 1.0f;
  *direction = (float3)(sine * p, cos(angle));
  return true;
#elif CAMERA_MODEL == RS_CAMERA_EQUIRECTANGULAR
  // In half turns, which sinpi and cospi take without loss.
  const float longitude = 2.0f * (((column - 0.5f * (float)c->width) + at.x) / (float)c->width);
  const float latitude = ((row - 0.5f * (float)c->height) + at.y) / (float)c->height;
  const float across = cospi(latitude);
  *direction = (float3)(sinpi(longitude) * across, sinpi(latitude), cospi(longitude) * across);
  return true;
#else
#error "unknown CAMERA_MODEL"
#endif
}
#endif

#endif
