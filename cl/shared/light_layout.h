// SPDX-License-Identifier: Apache-2.0
// Records of surfaces, materials, lights and paths that kernels and host share, under the rules of
// layout.h.
#ifndef RS_SHARED_LIGHT_LAYOUT_H
#define RS_SHARED_LIGHT_LAYOUT_H

#include "shared/layout.h"

// Where a ray meets a triangle: t, weights of the second and third corner; triangle -1 = nowhere.
typedef struct {
  rs_float t;
  rs_float u, v;
  rs_int triangle;
} RsSurfaceHit;
RS_STATIC_ASSERT_SIZE(RsSurfaceHit, 16);

// Numbers of a triangle's vertices: position, normal and texture coordinates of three corners.
#define RS_TRIANGLE_FLOATS 24

#define RS_DIFFUSE 0
#define RS_MIRROR 1
#define RS_GLASS 2
#define RS_TRANSPARENT 3
#define RS_EMISSIVE 4

typedef struct {
  rs_int kind;  // RS_DIFFUSE ...
  rs_float color[3];
  rs_int texture;  // -1 = none
  rs_float specular, roughness, ior;
  rs_float absorption[3];
  rs_float opacity;
  rs_float emission[3];
  rs_float shadow;  // share of light taken from a shadow ray
} RsMaterial;
RS_STATIC_ASSERT_SIZE(RsMaterial, 64);

typedef struct {
  rs_uint offset;  // of the first texel, three floats each
  rs_int width, height;
  rs_int padding;
} RsTexture;
RS_STATIC_ASSERT_SIZE(RsTexture, 16);

#define RS_LIGHT_POINT 0
#define RS_LIGHT_DIRECTIONAL 1
#define RS_LIGHT_SPHERE 2

typedef struct {
  rs_int kind;
  rs_float position[3];
  rs_float direction[3];  // unit, in which a directional light shines
  rs_float color[3];
  rs_float radius;
  rs_int padding;
} RsLight;
RS_STATIC_ASSERT_SIZE(RsLight, 48);

// What rays that leave the scene see.
typedef struct {
  rs_float color[3];
  rs_int width, height;  // of the equirectangular picture, 0 = constant colour
  rs_float right[3], up[3], forward[3];
  rs_float light[27];  // on a surface: nine coefficients of the normal, RGB innermost
  rs_int padding;
} RsEnvironment;
RS_STATIC_ASSERT_SIZE(RsEnvironment, 168);

// One path between two surfaces. Its ray is kept beside it.
typedef struct {
  rs_int skip;     // triangle that the ray starts on, -1 = none; must be the first word
  rs_uint pixel;   // within the batch
  rs_float begin;  // t from which Gaussians and absorption count
  rs_float throughput[3];
  rs_uint media[2];        // glass bodies around it: material + 1 in 16 bits each, innermost lowest
  rs_uint splits;          // glass surfaces that did both
  rs_uint lineage;         // tells the parts of a split path apart
  rs_int blind;            // 1: the pixel sees nothing
  rs_int direct;           // 1: straight from the camera's centre
  rs_float width, spread;  // of the ray's RsCone
} RsPath;
RS_STATIC_ASSERT_SIZE(RsPath, 56);

// Where a path meets a surface; normals are turned to the side it comes from.
typedef struct {
  rs_float position[3];
  rs_int material;  // -1 = no surface
  rs_float shading[3];
  rs_int entering;  // 1 when the ray comes from the triangle's outside
  rs_float normal[3];
  rs_int triangle;
  rs_float color[3];
  rs_float t;
  rs_float offset;            // of rays that start on it
  rs_float shadow_origin[3];  // where those to lights start, without the offset
} RsSurface;
RS_STATIC_ASSERT_SIZE(RsSurface, 80);

// What all kernels of a wave must know.
typedef struct {
  rs_uint seed_lo, seed_hi;
  rs_uint sample;
  rs_uint scatter;  // 1 = rough mirrors do; a picture of one sample alone is sharp
  rs_int bounce, max_bounces;
  rs_float min_throughput;
  rs_int indirect;
  rs_float ambient[3];
  rs_float strength;
  rs_float bias;
  rs_int lights, light_samples;
  rs_uint first_pixel;  // of the batch
} RsWave;
RS_STATIC_ASSERT_SIZE(RsWave, 64);

#endif
