// SPDX-License-Identifier: Apache-2.0
// round_exact_lines: the exact sums of the gradients of lines (exact_sum.h), rounded to floats;
// sums that were touched are made ready for the next pass. One work-item per Gaussian, any local
// size. Reads 384 bytes per Gaussian, and writes them where a ray has met it.
#include "trace/exact_sum.h"

__kernel void round_exact_lines(const uint count,
                                __global uint* restrict sums,
                                __global float* restrict line_gradients) {
  const size_t i = get_global_id(0);
  if (i >= count) return;
  __global uint* words = sums + i * (16 * RS_EXACT_WORDS);
  uint changed = 0;
  for (int k = 0; k < 16 * RS_EXACT_WORDS; ++k) changed |= words[k] ^ RS_EXACT_BIAS;
  for (int c = 0; c < 16; ++c) {
    float value = 0.0f;
    if (changed != 0) {
      uint sum[RS_EXACT_WORDS];
      for (int k = 0; k < RS_EXACT_WORDS; ++k) sum[k] = words[16 * k + c];
      value = rs_exact_value(sum);
    }
    line_gradients[16 * i + c] = value;
  }
  if (changed == 0) return;
  for (int k = 0; k < 16 * RS_EXACT_WORDS; ++k) words[k] = RS_EXACT_BIAS;
}
