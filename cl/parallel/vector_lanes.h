// SPDX-License-Identifier: Apache-2.0
// Vectors of LANES lanes, written once for every width (1 suits GPUs): floats, integers and words.
// OpenCL's comparisons yield -1 in vectors and 1 in scalars, hence RS_MASK; rs_pick is a ternary
// that takes both.
#ifndef RS_PRIMITIVES_VECTOR_LANES_H
#define RS_PRIMITIVES_VECTOR_LANES_H

#ifndef LANES
#define LANES 4
#endif

#if LANES == 1
typedef float fv;
typedef int iv;
typedef uint uv;
#define RS_MASK(comparison) (-(comparison))
#define RS_LANE_INDEX (0)
#define rs_as_int(v) as_int(v)
#define rs_as_float(v) as_float(v)
#define rs_to_float(v) ((float)(v))
#define rs_to_int(v) ((int)(v))
#else
#define RS_MASK(comparison) (comparison)
#if LANES == 2
typedef float2 fv;
typedef int2 iv;
typedef uint2 uv;
#define RS_LANE_INDEX ((iv)(0, 1))
#define rs_as_int(v) as_int2(v)
#define rs_as_float(v) as_float2(v)
#define rs_to_float(v) convert_float2(v)
#define rs_to_int(v) convert_int2(v)
#elif LANES == 4
typedef float4 fv;
typedef int4 iv;
typedef uint4 uv;
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3))
#define rs_as_int(v) as_int4(v)
#define rs_as_float(v) as_float4(v)
#define rs_to_float(v) convert_float4(v)
#define rs_to_int(v) convert_int4(v)
#elif LANES == 8
typedef float8 fv;
typedef int8 iv;
typedef uint8 uv;
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3, 4, 5, 6, 7))
#define rs_as_int(v) as_int8(v)
#define rs_as_float(v) as_float8(v)
#define rs_to_float(v) convert_float8(v)
#define rs_to_int(v) convert_int8(v)
#elif LANES == 16
typedef float16 fv;
typedef int16 iv;
typedef uint16 uv;
#define RS_LANE_INDEX ((iv)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define rs_as_int(v) as_int16(v)
#define rs_as_float(v) as_float16(v)
#define rs_to_float(v) convert_float16(v)
#define rs_to_int(v) convert_int16(v)
#endif
#endif

// Loads and stores at any multiple of 4 bytes. vloadN and vstoreN mean the same, but some
// implementations take them apart; an access through a type of smaller alignment stays one
// instruction.
typedef fv rs_unaligned __attribute__((aligned(4)));
typedef iv rs_int_unaligned __attribute__((aligned(4)));
typedef uv rs_uint_unaligned __attribute__((aligned(4)));
#define rs_load(p) (*(__global const rs_unaligned*)(p))
#define rs_load_words(p) (*(__global const rs_uint_unaligned*)(p))
#define rs_store(v, p) (*(__global rs_unaligned*)(p) = (v))
#define rs_load_private(p) (*(const rs_unaligned*)(p))
#define rs_load_private_words(p) (*(const rs_uint_unaligned*)(p))
#define rs_store_private(v, p) (*(rs_unaligned*)(p) = (v))

#define rs_pick(condition, yes, no) ((condition) ? (fv)(yes) : (fv)(no))

// Masks hold 0 or -1 in every lane. rs_any, rs_all: whether any, or every lane is set. any() and
// all() become one branch per pair of lanes in some compilers; a reduction becomes one test.
// Only where the compiler makes machine code of a CPU itself: what reads its intermediate code
// elsewhere need not know reductions.
#if LANES > 1 && defined(__has_builtin) && (defined(__x86_64__) || defined(__aarch64__))
#if __has_builtin(__builtin_reduce_or) && __has_builtin(__builtin_reduce_and)
#define RS_REDUCTIONS 1
#endif
#endif
#ifdef RS_REDUCTIONS
#define rs_any(mask) (__builtin_reduce_or(mask) != 0)
#define rs_all(mask) (__builtin_reduce_and(mask) != 0)
#else
#define rs_any(mask) any(mask)
#define rs_all(mask) all(mask)
#endif
// Whether a comparison, as it is, holds in any lane: for passes that ask once per vector, where a
// reduction is no faster.
#if LANES == 1
#define rs_any_of(condition) ((condition) != 0)
#else
#define rs_any_of(condition) any(condition)
#endif

// One bit per lane whose mask is set, lane 0 lowest. OpenCL C has no word for what x86 does in one
// instruction; the plain form gives the same.
#if LANES == 16 && defined(__AVX512DQ__) && defined(__clang__)
#define rs_lane_bits(mask) ((uint)__builtin_ia32_cvtd2mask512(mask))
#elif LANES == 8 && defined(__AVX__) && defined(__clang__)
#define rs_lane_bits(mask) ((uint)__builtin_ia32_movmskps256(as_float8(mask)))
#elif LANES == 4 && defined(__SSE__) && defined(__clang__)
#define rs_lane_bits(mask) ((uint)__builtin_ia32_movmskps(as_float4(mask)))
#elif LANES == 1
#define rs_lane_bits(mask) ((uint)((mask)&1))
#else
uint rs_lane_bits(iv mask) {
  const iv bit = mask & ((iv)(1) << RS_LANE_INDEX);
#if LANES == 16
  const int8 b8 = bit.lo | bit.hi;
  const int4 b4 = b8.lo | b8.hi;
#elif LANES == 8
  const int4 b4 = bit.lo | bit.hi;
#elif LANES == 4
  const int4 b4 = bit;
#endif
#if LANES == 2
  return bit.x | bit.y;
#else
  const int2 b2 = b4.lo | b4.hi;
  return b2.x | b2.y;
#endif
}
#endif

uint rs_lowest_bit(uint bits) { return 31 - clz(bits & -bits); }

// Writes first + i for every lane i whose bit is set, in order, and returns their number. May write
// up to LANES values in all.
uint rs_append_lanes(uint* to, const uint first, uint bits) {
#if LANES == 1
  *to = first;
  return bits;
#elif LANES == 16 && defined(__AVX512F__) && defined(__clang__)
  const int16 lanes = RS_LANE_INDEX + (int)first;
  *(rs_int_unaligned*)to = __builtin_ia32_compresssi512_mask(lanes, lanes, (ushort)bits);
  return popcount(bits);
#else
  uint count = 0;
  for (; bits != 0; bits &= bits - 1) to[count++] = first + rs_lowest_bit(bits);
  return count;
#endif
}

// Sum, least and greatest value over the lanes.
#if LANES == 1
float rs_lane_sum(fv v) { return v; }
float rs_lane_min(fv v) { return v; }
float rs_lane_max(fv v) { return v; }
#elif LANES == 2
float rs_lane_sum(fv v) { return v.x + v.y; }
float rs_lane_min(fv v) { return fmin(v.x, v.y); }
float rs_lane_max(fv v) { return fmax(v.x, v.y); }
#else
#if LANES == 16
#define RS_FOLD(v, op)                  \
  const float8 v8 = op((v).lo, (v).hi); \
  const float4 v4 = op(v8.lo, v8.hi);
#elif LANES == 8
#define RS_FOLD(v, op) const float4 v4 = op((v).lo, (v).hi);
#else
#define RS_FOLD(v, op) const float4 v4 = (v);
#endif
#define RS_PLUS(a, b) ((a) + (b))
// Not fmin and fmax, whose rule for NaN costs more than the comparison.
#define RS_LESSER(a, b) ((a) < (b) ? (a) : (b))
#define RS_GREATER(a, b) ((a) > (b) ? (a) : (b))
float rs_lane_sum(fv v) {
  RS_FOLD(v, RS_PLUS)
  const float2 v2 = v4.lo + v4.hi;
  return v2.x + v2.y;
}
float rs_lane_min(fv v) {
  RS_FOLD(v, RS_LESSER)
  const float2 v2 = RS_LESSER(v4.lo, v4.hi);
  return RS_LESSER(v2.x, v2.y);
}
float rs_lane_max(fv v) {
  RS_FOLD(v, RS_GREATER)
  const float2 v2 = RS_GREATER(v4.lo, v4.hi);
  return RS_GREATER(v2.x, v2.y);
}
#endif

// exp(x) for x <= 0 with a relative error below 2e-7 (arguments below -80 count as -80): some
// OpenCL implementations evaluate the built-in lane by lane. 2^n by exponent arithmetic, 2^f by a
// polynomial on
// [-1/2, 1/2] (Taylor of 2^f, degree 6).
fv rs_exp(fv x) {
  const fv y = (x > -80.0f ? x : (fv)(-80.0f)) * 1.44269504f;
  const fv shifted = y + 12582912.0f;  // 1.5 * 2^23: rounds y to an integer in the low bits
  const fv f = y - (shifted - 12582912.0f);
  fv p = 1.54035304e-4f * f + 1.33335581e-3f;
  p = p * f + 9.61812911e-3f;
  p = p * f + 5.55041087e-2f;
  p = p * f + 0.240226507f;
  p = p * f + 0.693147181f;
  p = p * f + 1.0f;
  return rs_as_float(rs_as_int(p) + (rs_as_int(shifted) << 23));
}

#endif
