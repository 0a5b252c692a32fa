// SPDX-License-Identifier: Apache-2.0
// Random numbers that are a function of (seed, pixel, sample, dimension) alone, so that a picture
// does not depend on the order in which a device computes it. Host and kernels compile this file.
// Hash: pcg4d of Jarzynski and Olano 2020, "Hash Functions for GPU Rendering".
#ifndef RS_SHARED_RANDOM_H
#define RS_SHARED_RANDOM_H

#include "shared/compat.h"

#ifndef __OPENCL_C_VERSION__
#define RS_RANDOM_FUNCTION inline
#else
#define RS_RANDOM_FUNCTION
#endif

// Four dimensions at once, each uniform in [0, 1) with 24 bits.
typedef struct {
  rs_float x, y, z, w;
} RsRandom4;

typedef struct {
  rs_uint x, y, z, w;
} RsHash4;

RS_RANDOM_FUNCTION RsHash4 rs_pcg4d(RsHash4 v) {
  v.x = v.x * 1664525u + 1013904223u;
  v.y = v.y * 1664525u + 1013904223u;
  v.z = v.z * 1664525u + 1013904223u;
  v.w = v.w * 1664525u + 1013904223u;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  v.x ^= v.x >> 16;
  v.y ^= v.y >> 16;
  v.z ^= v.z >> 16;
  v.w ^= v.w >> 16;
  v.x += v.y * v.w;
  v.y += v.z * v.x;
  v.z += v.x * v.y;
  v.w += v.y * v.z;
  return v;
}

// Dimensions 4 block .. 4 block + 3 of one sample of a pixel. The four inputs of the hash are too
// few for five words, so the seed, the sample and the block are hashed first.
RS_RANDOM_FUNCTION RsRandom4 rs_random4(
    rs_uint seed_lo, rs_uint seed_hi, rs_uint pixel, rs_uint sample, rs_uint dimension_block) {
  RsHash4 v;
  RsRandom4 out;
  v.x = seed_lo;
  v.y = seed_hi;
  v.z = sample;
  v.w = dimension_block;
  v = rs_pcg4d(v);
  v.x += pixel;
  v = rs_pcg4d(v);
  out.x = (rs_float)(v.x >> 8) * (1.0f / 16777216.0f);
  out.y = (rs_float)(v.y >> 8) * (1.0f / 16777216.0f);
  out.z = (rs_float)(v.z >> 8) * (1.0f / 16777216.0f);
  out.w = (rs_float)(v.w >> 8) * (1.0f / 16777216.0f);
  return out;
}

#endif
