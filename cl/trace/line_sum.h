// SPDX-License-Identifier: Apache-2.0
// Sums of floats in lines of 16, one or more lines per Gaussian, to which many work-items add:
//   PRIVATE_COPIES 1: every work-item has sums of its own: plain additions, the same every time
//   EXACT_SUMS 1:     a long integer per float (exact_sum.h): the same bits in any order
//   otherwise:        floats that are shared (float_add.h, FLOAT_ATOMICS)
// O(1) per addition but for retries where floats are swapped.
#ifndef RS_TRACE_LINE_SUM_H
#define RS_TRACE_LINE_SUM_H

#include "parallel/float_add.h"
#include "parallel/prefetch.h"
#include "trace/exact_sum.h"

#ifndef PRIVATE_COPIES
#define PRIVATE_COPIES 0
#endif
#ifndef EXACT_SUMS
#define EXACT_SUMS 0
#endif

// `lines`: with EXACT_SUMS the words of the integers, RS_EXACT_WORDS times as many. `limit` bounds
// what one addition may bring to an exact sum.
typedef struct {
  __global float* lines;
  float limit;
} LineSums;

// Adds to float number `number`, counted through the lines.
void rs_add_sum(const LineSums* sums, const size_t number, const float value) {
#if PRIVATE_COPIES
  sums->lines[number] += value;
#elif EXACT_SUMS
  volatile __global uint* words = (volatile __global uint*)sums->lines;
  rs_exact_add(words + (number >> 4) * (16 * RS_EXACT_WORDS) + (number & 15), value, sums->limit);
#else
  rs_add_float(sums->lines + number, value);
#endif
}

// Line number `line` will be added to soon.
void rs_fetch_line(const LineSums* sums, const size_t line) {
  (void)sums;
  (void)line;
#if !EXACT_SUMS
  RS_PREFETCH_WRITE(sums->lines + line * 16);
#endif
}

// Adds the numbers begin .. end of `value` to those of line number `line`.
void rs_add_numbers(
    const LineSums* sums, const size_t line, const float16 value, const int begin, const int end) {
  union {
    float16 v;
    float s[16];
  } part;
  part.v = value;
#pragma unroll
  for (int i = begin; i < end; ++i) rs_add_sum(sums, line * 16 + i, part.s[i]);
}

// Adds to all of line number `line`.
void rs_add_line(const LineSums* sums, const size_t line, const float16 value) {
#if PRIVATE_COPIES
  *(__global float16*)(sums->lines + line * 16) += value;
#else
  rs_add_numbers(sums, line, value, 0, 16);
#endif
}

#endif
