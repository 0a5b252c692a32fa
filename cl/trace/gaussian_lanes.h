// SPDX-License-Identifier: Apache-2.0
// VECTOR Gaussians per work-item, one in each lane of a vector, written once for every width (1
// suits GPUs). Conditions are plain comparisons: they yield -1 in vectors and 1 in scalars, which
// `?:`, `&`, `|` and `!` take alike.
// Buffers keep the values of one Gaussian together. A column is one value of VECTOR consecutive
// Gaussians; `stride` counts the floats from one Gaussian to the next.
#ifndef RS_TRACE_GAUSSIAN_LANES_H
#define RS_TRACE_GAUSSIAN_LANES_H

#ifndef VECTOR
#define VECTOR 1
#endif

#if VECTOR == 1
typedef float gv;
typedef int gi;
typedef gv gv_unaligned;
typedef gi gi_unaligned;
#define RS_ANY_GAUSSIAN(mask) ((mask) != 0)
#define RS_AS_FLOAT(v) as_float(v)
#define RS_AS_INT(v) as_int(v)
#define RS_TO_FLOAT(v) ((float)(v))
#define RS_TO_INT(v) ((int)(v))
#define RS_COLUMN(type, p, s) ((p)[0 * (s)])
#else
#if VECTOR == 4
typedef float4 gv;
typedef int4 gi;
#define RS_AS_FLOAT(v) as_float4(v)
#define RS_AS_INT(v) as_int4(v)
#define RS_TO_FLOAT(v) convert_float4(v)
#define RS_TO_INT(v) convert_int4(v)
#define RS_COLUMN(type, p, s) ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)]))
#elif VECTOR == 8
typedef float8 gv;
typedef int8 gi;
#define RS_AS_FLOAT(v) as_float8(v)
#define RS_AS_INT(v) as_int8(v)
#define RS_TO_FLOAT(v) convert_float8(v)
#define RS_TO_INT(v) convert_int8(v)
#define RS_COLUMN(type, p, s)                                                                   \
  ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)], (p)[4 * (s)], (p)[5 * (s)], (p)[6 * (s)], \
          (p)[7 * (s)]))
#elif VECTOR == 16
typedef float16 gv;
typedef int16 gi;
#define RS_AS_FLOAT(v) as_float16(v)
#define RS_AS_INT(v) as_int16(v)
#define RS_TO_FLOAT(v) convert_float16(v)
#define RS_TO_INT(v) convert_int16(v)
#define RS_COLUMN(type, p, s)                                                                    \
  ((type)((p)[0], (p)[s], (p)[2 * (s)], (p)[3 * (s)], (p)[4 * (s)], (p)[5 * (s)], (p)[6 * (s)],  \
          (p)[7 * (s)], (p)[8 * (s)], (p)[9 * (s)], (p)[10 * (s)], (p)[11 * (s)], (p)[12 * (s)], \
          (p)[13 * (s)], (p)[14 * (s)], (p)[15 * (s)]))
#else
#error "VECTOR is 1, 4, 8 or 16"
#endif
// Some implementations take vload apart into scalars; a vector type of float's alignment stays one
// load.
typedef gv gv_unaligned __attribute__((aligned(4)));
typedef gi gi_unaligned __attribute__((aligned(4)));
#define RS_ANY_GAUSSIAN(mask) any(mask)
#endif

// Maximum and minimum as one instruction: b where a is not a number.
gv larger(gv a, gv b) { return a > b ? a : b; }
gv smaller(gv a, gv b) { return a < b ? a : b; }

// Lanes one by one.
typedef union {
  gv v;
  float s[VECTOR];
} FloatLanes;
typedef union {
  gi v;
  int s[VECTOR];
} IntLanes;

gv load_column(__global const float* p, const uint stride) { return RS_COLUMN(gv, p, stride); }

void store_column(gv value, __global float* p, const uint stride) {
  FloatLanes lanes;
  lanes.v = value;
#pragma unroll
  for (uint i = 0; i < VECTOR; ++i) p[i * stride] = lanes.s[i];
}

#if VECTOR > 1
// Perfect shuffle of the rows i and i + rows / 2: rotates the bits of (row, lane) by one to the
// left.
void shuffle_rows(const gv* from, gv* to, const int rows) {
#pragma unroll
  for (int i = 0; i < rows / 2; ++i) {
    gv a, b;
    a.even = from[i].lo;
    a.odd = from[i + rows / 2].lo;
    b.even = from[i].hi;
    b.odd = from[i + rows / 2].hi;
    to[2 * i] = a;
    to[2 * i + 1] = b;
  }
}
#endif

// Rows become columns: after log2(VECTOR) rotations row and lane have changed places.
void transpose(const gv* from, gv* to) {
#if VECTOR == 1
  to[0] = from[0];
#else
  gv part[VECTOR];
#if VECTOR == 8
  shuffle_rows(from, to, VECTOR);
  shuffle_rows(to, part, VECTOR);
#else
  shuffle_rows(from, part, VECTOR);
#endif
#if VECTOR == 16
  gv other[VECTOR];
  shuffle_rows(part, other, VECTOR);
  shuffle_rows(other, part, VECTOR);
#endif
  shuffle_rows(part, to, VECTOR);
#endif
}

// The first `count` columns.
void load_columns(__global const float* p, const uint stride, const uint count, gv* columns) {
  uint c = 0;
  for (; c + VECTOR <= count; c += VECTOR) {
    gv rows[VECTOR];
#pragma unroll
    for (uint i = 0; i < VECTOR; ++i) rows[i] = *(__global const gv_unaligned*)(p + i * stride + c);
    transpose(rows, columns + c);
  }
  for (; c < count; ++c) columns[c] = load_column(p + c, stride);
}

void store_columns(const gv* columns, const uint count, __global float* p, const uint stride) {
  uint c = 0;
  for (; c + VECTOR <= count; c += VECTOR) {
    gv rows[VECTOR];
    transpose(columns + c, rows);
#pragma unroll
    for (uint i = 0; i < VECTOR; ++i) *(__global gv_unaligned*)(p + i * stride + c) = rows[i];
  }
  for (; c < count; ++c) store_column(columns[c], p + c, stride);
}

// VECTOR records of eight floats side by side: the bits of (record, field) change places by
// rotations, as in transpose().
void load_records8(__global const float* p, gv* columns) {
#if VECTOR == 1
  for (int k = 0; k < 8; ++k) columns[k] = p[k];
#else
  gv part[8];
#pragma unroll
  for (int k = 0; k < 8; ++k) columns[k] = ((__global const gv_unaligned*)p)[k];
  shuffle_rows(columns, part, 8);
#if VECTOR == 8
  gv other[8];
  shuffle_rows(part, other, 8);
  shuffle_rows(other, columns, 8);
#else
  shuffle_rows(part, columns, 8);
#if VECTOR == 16
  shuffle_rows(columns, part, 8);
  shuffle_rows(part, columns, 8);
#endif
#endif
#endif
}

void store_records8(const gv* columns, __global float* p) {
#if VECTOR == 1
  for (int k = 0; k < 8; ++k) p[k] = columns[k];
#else
  gv part[8], other[8];
  shuffle_rows(columns, part, 8);
  shuffle_rows(part, other, 8);
  shuffle_rows(other, part, 8);
#pragma unroll
  for (int k = 0; k < 8; ++k) ((__global gv_unaligned*)p)[k] = part[k];
#endif
}

// Zeros all values of VECTOR Gaussians.
void clear_columns(__global float* p, const uint stride) {
  for (uint k = 0; k < stride; ++k) *(__global gv_unaligned*)(p + k * VECTOR) = (gv)(0.0f);
}

#endif
