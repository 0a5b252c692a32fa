// SPDX-License-Identifier: Apache-2.0
// What the device can do at best, for comparison with what the other kernels do: the rate of fused
// multiply-adds in registers, and the bandwidth of reading and writing large buffers; for the model
// of speed also other instructions, and reading and writing at random (below).
//   fma_chains   CHAINS independent float16 accumulators per work-item; `rounds` times CHAINS * 16
//                multiply-adds each
//                global size: any number of work-items
//   copy_runs    every work-item copies `run` consecutive float16s (suits CPUs)
//                global size: runs
//   copy_stride  neighbouring work-items copy neighbouring float4s (suits GPUs)
//                global size: float4s
//   rewrite_runs as copy_runs, but in place: caches that fetch a line before it is written move
//                half as much again for a copy
//                global size: runs
// O(rounds) and O(1) per element. Copying as in McCalpin's STREAM (1995): read and write both
// count.

#ifndef CHAINS
#define CHAINS 8
#endif

__kernel void fma_chains(__global float16* out, uint rounds, float factor, float term) {
  const uint i = get_global_id(0);
  const float16 a = (float16)(factor);
  const float16 b = (float16)(term);
  float16 x0 = (float16)((float)i), x1 = x0 + 1.0f, x2 = x0 + 2.0f, x3 = x0 + 3.0f;
#if CHAINS >= 8
  float16 x4 = x0 + 4.0f, x5 = x0 + 5.0f, x6 = x0 + 6.0f, x7 = x0 + 7.0f;
#endif
#if CHAINS >= 12
  float16 x8 = x0 + 8.0f, x9 = x0 + 9.0f, xa = x0 + 10.0f, xb = x0 + 11.0f;
#endif
  for (uint k = 0; k < rounds; ++k) {
    x0 = x0 * a + b;
    x1 = x1 * a + b;
    x2 = x2 * a + b;
    x3 = x3 * a + b;
#if CHAINS >= 8
    x4 = x4 * a + b;
    x5 = x5 * a + b;
    x6 = x6 * a + b;
    x7 = x7 * a + b;
#endif
#if CHAINS >= 12
    x8 = x8 * a + b;
    x9 = x9 * a + b;
    xa = xa * a + b;
    xb = xb * a + b;
#endif
  }
  x0 += x1 + x2 + x3;
#if CHAINS >= 8
  x0 += x4 + x5 + x6 + x7;
#endif
#if CHAINS >= 12
  x0 += x8 + x9 + xa + xb;
#endif
  out[i] = x0;
}

__kernel void copy_runs(__global const float16* restrict in,
                        __global float16* restrict out,
                        uint run) {
  const size_t begin = get_global_id(0) * (size_t)run;
  for (uint k = 0; k < run; ++k) out[begin + k] = in[begin + k];
}

__kernel void copy_stride(__global const float4* restrict in, __global float4* restrict out) {
  const size_t i = get_global_id(0);
  out[i] = in[i];
}

__kernel void rewrite_runs(__global float16* data, uint run) {
  const size_t begin = get_global_id(0) * (size_t)run;
  for (uint k = 0; k < run; ++k) data[begin + k] = -data[begin + k];
}

// Instructions that are no fused multiply-adds, as the tracing kernels have them: four chains of
// four dependent ones a round.
// global size: any number of work-items
__kernel void vector_steps(__global float16* out, uint rounds, float factor, float bound) {
  const uint i = get_global_id(0);
  const float16 a = (float16)(factor), b = (float16)(bound), c = (float16)(0.25f * bound);
  float16 x0 = (float16)((float)i), x1 = x0 + 1.0f, x2 = x0 + 2.0f, x3 = x0 + 3.0f;
  for (uint k = 0; k < rounds; ++k) {
    x0 = min(max(x0 * a, b) - c, a);
    x1 = min(max(x1 * a, b) - c, a);
    x2 = min(max(x2 * a, b) - c, a);
    x3 = min(max(x3 * a, b) - c, a);
  }
  out[i] = x0 + x1 + x2 + x3;
}

// Divisions and roots: four chains of one each a round.
// global size: any number of work-items
__kernel void slow_steps(__global float16* out, uint rounds, float factor) {
  const uint i = get_global_id(0);
  const float16 a = (float16)(factor);
  float16 x0 = (float16)(1.0f + (float)i), x1 = x0 + 1.0f, x2 = x0 + 2.0f, x3 = x0 + 3.0f;
  for (uint k = 0; k < rounds; ++k) {
    x0 = sqrt(a / x0);
    x1 = sqrt(a / x1);
    x2 = sqrt(a / x2);
    x3 = sqrt(a / x3);
  }
  out[i] = x0 + x1 + x2 + x3;
}

// Vectors that begin at any float of a table of mask + 17 floats, as windows slide over rows.
// global size: any number of work-items
__kernel void shifted_reads(__global const float* restrict table,
                            __global float16* restrict out,
                            uint rounds,
                            uint mask) {
  const uint i = get_global_id(0);
  uint place = i;
  float16 x0 = (float16)(0.0f), x1 = x0, x2 = x0, x3 = x0;
  for (uint k = 0; k < rounds; ++k) {
    __global const float* p = table + (place & mask);
    x0 += vload16(0, p + 1);
    x1 += vload16(0, p + 6);
    x2 += vload16(0, p + 11);
    x3 += vload16(0, p + 15);
    place += 16;
  }
  out[i] = x0 + x1 + x2 + x3;
}

// Whole vectors written in turn to the same lines of each work-item's: 4 a round, lines of 4 (mask
// + 1).
// global size: any number of work-items
__kernel void parked_vectors(__global float16* restrict lines,
                             uint rounds,
                             uint mask,
                             float factor) {
  __global float16* own = lines + get_global_id(0) * 4 * (size_t)(mask + 1);
  const float16 a = (float16)(factor);
  for (uint k = 0; k < rounds; ++k) {
    __global float16* place = own + 4 * (k & mask);
    place[0] = a;
    place[1] = a;
    place[2] = a;
    place[3] = a;
  }
}

// Lines of 64 bytes at random, of a table of mask + 1: no address waits for what was read.
// global size: any number of work-items
__kernel void random_lines(__global const float16* restrict table,
                           __global float16* restrict out,
                           uint rounds,
                           uint mask) {
  const uint i = get_global_id(0);
  uint place = 0x9e3779b9u * (i + 1);
  float16 sum = (float16)(0.0f);
  for (uint k = 0; k < rounds; ++k) {
    place = place * 1664525u + 1013904223u;
    sum += table[(place >> 6) & mask];
  }
  out[i] = sum;
}

// Whole numbers, one at a time: four chains of four dependent instructions a round.
// global size: any number of work-items
__kernel void scalar_steps(__global uint* out, uint rounds, uint factor) {
  const uint i = get_global_id(0);
  uint x0 = i, x1 = i + factor, x2 = i ^ factor, x3 = i * factor;
  for (uint k = 0; k < rounds; ++k) {
    x0 = ((x0 ^ (x0 >> 7)) + k) | 1u;
    x1 = ((x1 + (x1 << 3)) ^ k) - 5u;
    x2 = ((x2 - (x2 >> 5)) + k) ^ 9u;
    x3 = ((x3 ^ (x3 << 9)) - k) + 3u;
  }
  out[i] = x0 + x1 + x2 + x3;
}

// The same in runs of 16 lines: of a table of 16 (mask + 1).
// global size: any number of work-items
__kernel void random_runs(__global const float16* restrict table,
                          __global float16* restrict out,
                          uint rounds,
                          uint mask) {
  const uint i = get_global_id(0);
  uint place = 0x9e3779b9u * (i + 1);
  float16 sum = (float16)(0.0f);
  for (uint k = 0; k < rounds; ++k) {
    place = place * 1664525u + 1013904223u;
    __global const float16* run = table + (size_t)((place >> 6) & mask) * 16;
    for (uint j = 0; j < 16; ++j) sum += run[j];
  }
  out[i] = sum;
}

// The same of single lines where every one tells where the next one is: the table holds a cycle.
// global size: any number of work-items
__kernel void chased_lines(__global const uint16* restrict table,
                           __global uint* restrict out,
                           uint rounds,
                           uint mask) {
  const uint i = get_global_id(0);
  uint place = (0x9e3779b9u * (i + 1)) & mask;
  for (uint k = 0; k < rounds; ++k) place = table[place].s0;
  out[i] = place;
}

// Lines of planes of a picture in the order of its tiles, which are two lines wide and four rows
// high: `planes` planes of get_global_size(0) rows of tiles, `stride` lines a row, read `passes`
// times.
// global size: rows of tiles
__kernel void tiled_lines(__global const float16* restrict table,
                          __global float16* restrict out,
                          uint planes,
                          uint stride,
                          uint passes) {
  const size_t plane = get_global_size(0) * 4 * (size_t)stride;
  const size_t first = get_global_id(0) * 4 * (size_t)stride;
  float16 x0 = (float16)(0.0f), x1 = x0;
  for (uint k = 0; k < passes * stride; k += 2) {
    for (uint row = 0; row < 4; ++row) {
      for (uint p = 0; p < planes; ++p) {
        __global const float16* pair =
            table + p * plane + first + row * (size_t)stride + k % stride;
        x0 += pair[0];
        x1 += pair[1];
      }
    }
  }
  out[get_global_id(0)] = x0 + x1;
}

// Words of 8 bytes written at random into a table of mask + 1: what a sort's scatter waits for.
// global size: any number of work-items
__kernel void random_stores(__global uint2* restrict table, uint rounds, uint mask) {
  const uint i = get_global_id(0);
  uint place = 0x9e3779b9u * (i + 1);
  for (uint k = 0; k < rounds; ++k) {
    place = place * 1664525u + 1013904223u;
    table[(place >> 6) & mask] = (uint2)(place, k);
  }
}
