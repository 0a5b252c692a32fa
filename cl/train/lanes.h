// SPDX-License-Identifier: Apache-2.0
// VECTOR consecutive floats of a row in one vector, written once for every width. Comparisons yield
// -1 in vectors and 1 in scalars; `rs_pick` is a ternary that works on both.
#ifndef RS_TRAIN_LANES_H
#define RS_TRAIN_LANES_H

#ifndef VECTOR
#define VECTOR 4
#endif

#if VECTOR == 1
typedef float lanes;
typedef int lane_mask;
typedef uint lane_words;
#define RS_LANE_IDS (0)
#define rs_to_float(words) convert_float(words)
#define rs_as_float(words) as_float(words)
#elif VECTOR == 4
typedef float4 lanes;
typedef int4 lane_mask;
typedef uint4 lane_words;
#define RS_LANE_IDS ((int4)(0, 1, 2, 3))
#define rs_to_float(words) convert_float4(words)
#define rs_as_float(words) as_float4(words)
#elif VECTOR == 8
typedef float8 lanes;
typedef int8 lane_mask;
typedef uint8 lane_words;
#define RS_LANE_IDS ((int8)(0, 1, 2, 3, 4, 5, 6, 7))
#define rs_to_float(words) convert_float8(words)
#define rs_as_float(words) as_float8(words)
#elif VECTOR == 16
typedef float16 lanes;
typedef int16 lane_mask;
typedef uint16 lane_words;
#define RS_LANE_IDS ((int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define rs_to_float(words) convert_float16(words)
#define rs_as_float(words) as_float16(words)
#else
#error "VECTOR is 1, 4, 8 or 16"
#endif

// Loads and stores at any multiple of 4 bytes. vloadN and vstoreN mean the same, but PoCL 3.1 takes
// them apart into 8-byte pieces; an access through a type of smaller alignment stays one
// instruction.
typedef lanes unaligned_lanes __attribute__((aligned(4)));
typedef lane_words unaligned_words __attribute__((aligned(4)));
#define rs_load(p) (*(const __global unaligned_lanes*)(p))
#define rs_load_words(p) (*(const __global unaligned_words*)(p))
#define rs_store(value, p) (*(__global unaligned_lanes*)(p) = (value))
#define rs_load_private(p) (*(const unaligned_lanes*)(p))
#define rs_load_private_words(p) (*(const unaligned_words*)(p))
#define rs_store_private(value, p) (*(unaligned_lanes*)(p) = (value))

#define rs_pick(condition, yes, no) ((condition) ? (lanes)(yes) : (lanes)(no))

// Whether a comparison holds in any lane.
#if VECTOR == 1
#define rs_any_lane(mask) (mask)
#else
#define rs_any_lane(mask) any(mask)
#endif

// Sum over the lanes, always in the same order.
float rs_lanes_sum(lanes v) {
#if VECTOR == 1
  return v;
#else
#if VECTOR == 16
  const float8 v8 = v.lo + v.hi;
  const float4 v4 = v8.lo + v8.hi;
#elif VECTOR == 8
  const float4 v4 = v.lo + v.hi;
#else
  const float4 v4 = v;
#endif
  const float2 v2 = v4.lo + v4.hi;
  return v2.x + v2.y;
#endif
}

#endif
