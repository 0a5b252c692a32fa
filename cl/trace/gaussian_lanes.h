// SPDX-License-Identifier: Apache-2.0
// LANES Gaussians per work-item, one in each lane of a vector. Conditions are plain comparisons:
// they yield -1 in vectors and 1 in scalars, which `?:`, `&`, `|` and `!` take alike.
// Buffers keep the values of one Gaussian together. A column is one value of LANES consecutive
// Gaussians; `stride` counts the floats from one Gaussian to the next.
#ifndef RS_TRACE_GAUSSIAN_LANES_H
#define RS_TRACE_GAUSSIAN_LANES_H

#include "parallel/vector_lanes.h"

#if LANES == 1
#define RS_COLUMN(type, p, s) ((p)[0 * (s)])
#elif LANES == 4
#define RS_COLUMN(type, p, s) ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)]))
#elif LANES == 8
#define RS_COLUMN(type, p, s)                                                                   \
  ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)], (p)[4 * (s)], (p)[5 * (s)], (p)[6 * (s)], \
          (p)[7 * (s)]))
#elif LANES == 16
#define RS_COLUMN(type, p, s)                                                                    \
  ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)], (p)[4 * (s)], (p)[5 * (s)], (p)[6 * (s)],  \
          (p)[7 * (s)], (p)[8 * (s)], (p)[9 * (s)], (p)[10 * (s)], (p)[11 * (s)], (p)[12 * (s)], \
          (p)[13 * (s)], (p)[14 * (s)], (p)[15 * (s)]))
#else
#error "Gaussians are taken by 1, 4, 8 or 16"
#endif

// Maximum and minimum as one instruction: b where a is not a number.
fv larger(fv a, fv b) { return a > b ? a : b; }
fv smaller(fv a, fv b) { return a < b ? a : b; }

// Lanes one by one.
typedef union {
  fv v;
  float s[LANES];
} FloatLanes;
typedef union {
  iv v;
  int s[LANES];
} IntLanes;

fv load_column(__global const float* p, const uint stride) { return RS_COLUMN(fv, p, stride); }

void store_column(fv value, __global float* p, const uint stride) {
  FloatLanes lanes;
  lanes.v = value;
#pragma unroll
  for (uint i = 0; i < LANES; ++i) p[i * stride] = lanes.s[i];
}

#if LANES > 1
// Perfect shuffle of the rows i and i + rows / 2: rotates the bits of (row, lane) by one to the
// left.
void shuffle_rows(const fv* from, fv* to, const int rows) {
#pragma unroll
  for (int i = 0; i < rows / 2; ++i) {
    fv a, b;
    a.even = from[i].lo;
    a.odd = from[i + rows / 2].lo;
    b.even = from[i].hi;
    b.odd = from[i + rows / 2].hi;
    to[2 * i] = a;
    to[2 * i + 1] = b;
  }
}
#endif

// Rows become columns: after log2(LANES) rotations row and lane have changed places.
void transpose(const fv* from, fv* to) {
#if LANES == 1
  to[0] = from[0];
#else
  fv part[LANES];
#if LANES == 8
  shuffle_rows(from, to, LANES);
  shuffle_rows(to, part, LANES);
#else
  shuffle_rows(from, part, LANES);
#endif
#if LANES == 16
  fv other[LANES];
  shuffle_rows(part, other, LANES);
  shuffle_rows(other, part, LANES);
#endif
  shuffle_rows(part, to, LANES);
#endif
}

// Three and four values of LANES Gaussians side by side, by shuffles of whole vectors: columns
// loaded one by one become gathers.
void load_columns3(__global const float* p, fv* columns) {
#if LANES == 1
  for (int j = 0; j < 3; ++j) columns[j] = p[j];
#else
  const fv a = ((__global const rs_unaligned*)p)[0];
  const fv b = ((__global const rs_unaligned*)p)[1];
  const fv c = ((__global const rs_unaligned*)p)[2];
#if LANES == 4
  columns[0] = (fv)(a.s03, b.s2, c.s1);
  columns[1] = (fv)(a.s1, b.s03, c.s2);
  columns[2] = (fv)(a.s2, b.s1, c.s03);
#elif LANES == 8
  columns[0] = (fv)(a.s036, b.s147, c.s25);
  columns[1] = (fv)(a.s147, b.s25, c.s036);
  columns[2] = (fv)(a.s25, b.s036, c.s147);
#else
  columns[0] = (fv)(a.s0369, a.scf, b.s258b, b.se, c.s147a, c.sd);
  columns[1] = (fv)(a.s147a, a.sd, b.s0369, b.scf, c.s258b, c.se);
  columns[2] = (fv)(a.s258b, a.se, b.s147a, b.sd, c.s0369, c.scf);
#endif
#endif
}

void store_columns3(const fv x, const fv y, const fv z, __global float* p) {
#if LANES == 1
  p[0] = x;
  p[1] = y;
  p[2] = z;
#else
  __global rs_unaligned* rows = (__global rs_unaligned*)p;
#if LANES == 4
  rows[0] = (fv)(x.s0, y.s0, z.s0, x.s1);
  rows[1] = (fv)(y.s1, z.s1, x.s2, y.s2);
  rows[2] = (fv)(z.s2, x.s3, y.s3, z.s3);
#elif LANES == 8
  rows[0] = (fv)(x.s0, y.s0, z.s0, x.s1, y.s1, z.s1, x.s2, y.s2);
  rows[1] = (fv)(z.s2, x.s3, y.s3, z.s3, x.s4, y.s4, z.s4, x.s5);
  rows[2] = (fv)(y.s5, z.s5, x.s6, y.s6, z.s6, x.s7, y.s7, z.s7);
#else
  rows[0] = (fv)(x.s0, y.s0, z.s0, x.s1, y.s1, z.s1, x.s2, y.s2, z.s2, x.s3, y.s3, z.s3, x.s4, y.s4,
                 z.s4, x.s5);
  rows[1] = (fv)(y.s5, z.s5, x.s6, y.s6, z.s6, x.s7, y.s7, z.s7, x.s8, y.s8, z.s8, x.s9, y.s9, z.s9,
                 x.sa, y.sa);
  rows[2] = (fv)(z.sa, x.sb, y.sb, z.sb, x.sc, y.sc, z.sc, x.sd, y.sd, z.sd, x.se, y.se, z.se, x.sf,
                 y.sf, z.sf);
#endif
#endif
}

void load_columns4(__global const float* p, fv* columns) {
#if LANES == 1
  for (int j = 0; j < 4; ++j) columns[j] = p[j];
#else
  // Even and odd lanes apart, twice: the bits of (Gaussian, value) rotate to the right.
  fv even[4];
#pragma unroll
  for (int k = 0; k < 2; ++k) {
    const fv a = ((__global const rs_unaligned*)p)[2 * k];
    const fv b = ((__global const rs_unaligned*)p)[2 * k + 1];
    even[k] = (fv)(a.even, b.even);
    even[k + 2] = (fv)(a.odd, b.odd);
  }
#pragma unroll
  for (int k = 0; k < 2; ++k) {
    columns[k] = (fv)(even[2 * k].even, even[2 * k + 1].even);
    columns[k + 2] = (fv)(even[2 * k].odd, even[2 * k + 1].odd);
  }
#endif
}

void store_columns4(const fv* columns, __global float* p) {
#if LANES == 1
  for (int j = 0; j < 4; ++j) p[j] = columns[j];
#else
  fv part[4], rows[4];
  shuffle_rows(columns, part, 4);
  shuffle_rows(part, rows, 4);
#pragma unroll
  for (int k = 0; k < 4; ++k) ((__global rs_unaligned*)p)[k] = rows[k];
#endif
}

// The first `count` columns.
void load_columns(__global const float* p, const uint stride, const uint count, fv* columns) {
  if (stride == 3 && count == 3) {
    load_columns3(p, columns);
    return;
  }
  uint c = 0;
  for (; c + LANES <= count; c += LANES) {
    fv rows[LANES];
#pragma unroll
    for (uint i = 0; i < LANES; ++i) rows[i] = *(__global const rs_unaligned*)(p + i * stride + c);
    transpose(rows, columns + c);
  }
  for (; c < count; ++c) columns[c] = load_column(p + c, stride);
}

void store_columns(const fv* columns, const uint count, __global float* p, const uint stride) {
  if (stride == 3 && count == 3) {
    store_columns3(columns[0], columns[1], columns[2], p);
    return;
  }
  uint c = 0;
  for (; c + LANES <= count; c += LANES) {
    fv rows[LANES];
    transpose(columns + c, rows);
#pragma unroll
    for (uint i = 0; i < LANES; ++i) *(__global rs_unaligned*)(p + i * stride + c) = rows[i];
  }
  for (; c < count; ++c) store_column(columns[c], p + c, stride);
}

// LANES records of eight floats side by side: the bits of (record, field) change places by
// rotations, as in transpose().
void load_records8(__global const float* p, fv* columns) {
#if LANES == 1
  // Records lie at multiples of their 32 bytes.
  const float4 low = ((__global const float4*)p)[0], high = ((__global const float4*)p)[1];
  columns[0] = low.x;
  columns[1] = low.y;
  columns[2] = low.z;
  columns[3] = low.w;
  columns[4] = high.x;
  columns[5] = high.y;
  columns[6] = high.z;
  columns[7] = high.w;
#else
  fv part[8];
#pragma unroll
  for (int k = 0; k < 8; ++k) columns[k] = ((__global const rs_unaligned*)p)[k];
  shuffle_rows(columns, part, 8);
#if LANES == 8
  fv other[8];
  shuffle_rows(part, other, 8);
  shuffle_rows(other, columns, 8);
#else
  shuffle_rows(part, columns, 8);
#if LANES == 16
  shuffle_rows(columns, part, 8);
  shuffle_rows(part, columns, 8);
#endif
#endif
#endif
}

void store_records8(const fv* columns, __global float* p) {
#if LANES == 1
  for (int k = 0; k < 8; ++k) p[k] = columns[k];
#else
  fv part[8], other[8];
  shuffle_rows(columns, part, 8);
  shuffle_rows(part, other, 8);
  shuffle_rows(other, part, 8);
#pragma unroll
  for (int k = 0; k < 8; ++k) ((__global rs_unaligned*)p)[k] = part[k];
#endif
}

// Zeros all values of LANES Gaussians.
void clear_columns(__global float* p, const uint stride) {
  for (uint k = 0; k < stride; ++k) *(__global rs_unaligned*)(p + k * LANES) = (fv)(0.0f);
}

#endif
