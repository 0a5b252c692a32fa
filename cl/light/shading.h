// SPDX-License-Identifier: Apache-2.0
// What surfaces do with light, as functions of directions and numbers (docs/light.md).
#ifndef RS_LIGHT_SHADING_H
#define RS_LIGHT_SHADING_H

#include "shared/light_layout.h"
#include "shared/random.h"
#include "shared/sh.h"

#define RS_PI 3.14159265358979f

float3 load3(const float* p) { return (float3)(p[0], p[1], p[2]); }

float max3(float3 v) { return fmax(v.x, fmax(v.y, v.z)); }

float3 reflected(float3 d, float3 n) { return d - 2.0f * dot(d, n) * n; }

// Two unit vectors that make a frame with n (Duff et al. 2017).
void frame_of(float3 n, float3* a, float3* b) {
  const float sign = n.z >= 0.0f ? 1.0f : -1.0f;
  const float s = -1.0f / (sign + n.z);
  const float t = n.x * n.y * s;
  *a = (float3)(1.0f + sign * n.x * n.x * s, sign * t, -sign * n.x);
  *b = (float3)(t, sign + n.y * n.y * s, -n.y);
}

// Unpolarised reflectance of a dielectric; cosine of the incoming side, ratio = n_in / n_out.
// *cosine_out belongs to the refracted ray. 1 beyond the critical angle.
float fresnel(float cosine, float ratio, float* cosine_out) {
  const float sine2 = ratio * ratio * fmax(1.0f - cosine * cosine, 0.0f);
  *cosine_out = 0.0f;
  if (sine2 >= 1.0f) return 1.0f;
  const float out = sqrt(1.0f - sine2);
  *cosine_out = out;
  const float s = (ratio * cosine - out) / (ratio * cosine + out);
  const float p = (cosine - ratio * out) / (cosine + ratio * out);
  return 0.5f * (s * s + p * p);
}

// Exponent of the specular lobe of a roughness.
float lobe_exponent(float roughness) {
  const float r = fmax(roughness, 0.02f);
  return clamp(2.0f / (r * r * r * r) - 2.0f, 1.0f, 1e4f);
}

// Normal of a microfacet about n, after the GGX distribution of width roughness^2 (Walter et al.
// 2007).
float3 ggx_normal(float3 n, float roughness, float u, float v) {
  const float width = roughness * roughness;
  const float tangent2 = width * width * u / fmax(1.0f - u, 1e-7f);
  const float cosine = 1.0f / sqrt(1.0f + tangent2);
  const float sine = sqrt(fmax(1.0f - cosine * cosine, 0.0f));
  float3 a, b;
  frame_of(n, &a, &b);
  return normalize(sine * cos(2.0f * RS_PI * v) * a + sine * sin(2.0f * RS_PI * v) * b +
                   cosine * n);
}

// A direction about n with a density proportional to the cosine.
float3 cosine_direction(float3 n, float u, float v) {
  float3 a, b;
  frame_of(n, &a, &b);
  const float r = sqrt(u);
  return normalize(r * cos(2.0f * RS_PI * v) * a + r * sin(2.0f * RS_PI * v) * b +
                   sqrt(fmax(1.0f - u, 0.0f)) * n);
}

// The glass bodies that a path is in: material + 1 in 16 bits each, the innermost lowest.
typedef ulong Media;

RsCone cone_of_path(__global const RsPath* path) {
  const RsCone cone = {path->width, path->spread};
  return cone;
}

Media media_of(__global const RsPath* path) {
  return (Media)path->media[0] | (Media)path->media[1] << 32;
}

void store_media(Media media, RsPath* path) {
  path->media[0] = (uint)media;
  path->media[1] = (uint)(media >> 32);
}

uint innermost(Media media) { return (uint)media & 0xffffu; }

// Nothing changes when four bodies are nested already.
Media media_enter(Media media, uint body) { return media >> 48 ? media : media << 16 | body; }

// Without the innermost entry of `body`; the same when there is none.
Media media_leave(Media media, uint body) {
  for (uint bits = 0; bits < 64; bits += 16) {
    if (innermost(media >> bits) != body) continue;
    const Media inside = ((Media)1 << bits) - 1;
    return (media & inside) | (media >> 16 & ~inside);
  }
  return media;
}

float innermost_ior(Media media, __global const RsMaterial* materials) {
  return innermost(media) != 0 ? materials[innermost(media) - 1].ior : 1.0f;
}

float largest(float3 v) { return fmax(fmax(fabs(v.x), fabs(v.y)), fabs(v.z)); }

// How far a ray from a point p of the triangle a, b, c has to start off it not to meet its
// neighbours: a few units in the last place of what p is made of (after Waechter and Binder 2019).
float surface_offset(float3 p, float3 a, float3 b, float3 c) {
  return fmax(1.5e-6f * largest(p), 3e-7f * fmax(largest(a), fmax(largest(b), largest(c))));
}

// Start of a ray from p along the unit vector d, to the side of the unit normal n that d points to.
// It is half the offset back: where another surface meets this one at an angle, rounding may put p
// behind that one.
float3 start_off_surface(float3 p, float3 n, float3 d, float offset) {
  return p + offset * (n - 0.5f * d);
}

// Where a ray along d meets a triangle. vertices: per triangle three corners of eight floats
// (position, normal, uv); a flat triangle has zero normals.
typedef struct {
  float3 position;
  float3 normal;   // of the triangle, turned against d
  float3 shading;  // between those of the corners, on the same side
  float offset;    // of rays that start there
  bool entering;   // d comes from the triangle's outside
} SurfacePoint;

SurfacePoint surface_point(__global const float* vertices,
                           const RsSurfaceHit* hit,
                           const float3 d) {
  __global const float* v = vertices + (size_t)hit->triangle * RS_TRIANGLE_FLOATS;
  const float3 a = vload3(0, v), b = vload3(0, v + 8), c = vload3(0, v + 16);
  const float w = 1.0f - hit->u - hit->v;
  SurfacePoint out;
  out.position = w * a + hit->u * b + hit->v * c;
  const float3 normal = normalize(cross(b - a, c - a));
  out.entering = dot(d, normal) < 0.0f;
  out.normal = out.entering ? normal : -normal;
  const float3 between =
      w * vload3(0, v + 3) + hit->u * vload3(0, v + 11) + hit->v * vload3(0, v + 19);
  const float length2 = dot(between, between);
  const float3 shading = length2 > 1e-12f ? between * rsqrt(length2) : out.normal;
  out.shading = dot(shading, out.normal) < 0.0f ? -shading : shading;
  out.offset = surface_offset(out.position, a, b, c);
  return out;
}

// Least cosine between a triangle's normal and those of its corners that those of something round
// have: 43 degrees, below the 45 of an edge between two faces of a box, whose corners have 55, and
// above the 41 of a ball of 6 x 3 facets.
#define RS_ROUND_COSINE 0.73f

// Where rays from there to lights start. Where normals of corners say that the surface is round,
// the flat triangle lies behind it, and a ray from the triangle would meet its neighbours although
// the normal faces the light. So the point is projected onto the plane of each corner and its
// normal, where it lies behind that plane, and the projections are weighted as the corners are
// (Hanika 2021, Hacking the Shadow Terminator). A normal that leans farther than a round surface's
// is the mean at a sharp edge and says nothing of the kind: its corner stays out of it. The point
// itself without normals.
float3 shadow_origin(__global const float* vertices,
                     const RsSurfaceHit* hit,
                     const SurfacePoint* point) {
  __global const float* v = vertices + (size_t)hit->triangle * RS_TRIANGLE_FLOATS;
  const float weights[3] = {1.0f - hit->u - hit->v, hit->u, hit->v};
  float3 out = point->position;
  for (int k = 0; k < 3; ++k) {
    const float3 normal = vload3(0, v + 8 * k + 3);
    const float length2 = dot(normal, normal);
    if (length2 <= 1e-12f) continue;
    const float cosine = dot(normal, point->normal) * rsqrt(length2);
    if (fabs(cosine) < RS_ROUND_COSINE) continue;
    const float3 n = normal * copysign(rsqrt(length2), cosine);
    const float behind = dot(vload3(0, v + 8 * k) - point->position, n);
    out += weights[k] * fmax(behind, 0.0f) * n;
  }
  return out;
}

// Its texture coordinates.
float2 surface_uv(__global const float* vertices, const RsSurfaceHit* hit) {
  __global const float* v = vertices + (size_t)hit->triangle * RS_TRIANGLE_FLOATS;
  return (1.0f - hit->u - hit->v) * vload2(0, v + 6) + hit->u * vload2(0, v + 14) +
         hit->v * vload2(0, v + 22);
}

float3 environment_light(__global const RsEnvironment* environment, float3 n) {
  float basis[9];
  rs_sh_basis(2, n.x, n.y, n.z, basis);
  float3 sum = (float3)(0.0f);
  for (int k = 0; k < 9; ++k) sum += basis[k] * vload3(k, environment->light);
  return fmax(sum, (float3)(0.0f));
}

// Bilinear between texel centres; x repeats, y is held at the borders unless it repeats too.
float3 bilinear(
    __global const float* texels, int width, int height, float x, float y, bool repeat_y) {
  x -= 0.5f;
  y -= 0.5f;
  const float fx = floor(x), fy = floor(y);
  const float ax = x - fx, ay = y - fy;
  int x0 = (int)fx % width, y0 = (int)fy;
  if (x0 < 0) x0 += width;
  const int x1 = x0 + 1 == width ? 0 : x0 + 1;
  int y1 = y0 + 1;
  if (repeat_y) {
    y0 = y0 % height + (y0 % height < 0 ? height : 0);
    y1 = y0 + 1 == height ? 0 : y0 + 1;
  } else {
    y0 = clamp(y0, 0, height - 1);
    y1 = clamp(y1, 0, height - 1);
  }
  const size_t upper = (size_t)y0 * width, lower = (size_t)y1 * width;
  const float3 a = mix(vload3(upper + x0, texels), vload3(upper + x1, texels), ax);
  const float3 b = mix(vload3(lower + x0, texels), vload3(lower + x1, texels), ax);
  return mix(a, b, ay);
}

float3 environment_color(__global const RsEnvironment* environment,
                         __global const float* picture,
                         float3 d) {
  const float3 color = vload3(0, environment->color);
  if (environment->width == 0) return color;
  const float x = dot(d, vload3(0, environment->right));
  const float y = dot(d, vload3(0, environment->up));
  const float z = dot(d, vload3(0, environment->forward));
  const float u = 0.5f + atan2(x, z) * (0.5f / RS_PI);
  const float v = acos(clamp(y, -1.0f, 1.0f)) / RS_PI;
  return color * bilinear(picture, environment->width, environment->height, u * environment->width,
                          v * environment->height, false);
}

#endif
