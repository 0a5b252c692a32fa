// SPDX-License-Identifier: Apache-2.0
// Morton order of boxes: bounds of the centres (center_bounds, then finish_center_bounds), 63-bit
// codes of the centres (morton_codes), and the repair of short runs of equal high words after a
// sort by the high word alone (sort_runs). All O(n). Codes: Morton 1966, as used by Lauterbach et
// al. 2009.
//
// The grid has one cell size for all axes, a power of two: codes are exact and equal on every
// device, and the longest axis is split first.
#include "bvh/box.h"

#ifndef RS_GROUP
#define RS_GROUP 1
#endif
#ifndef RS_MAX_RUN
#define RS_MAX_RUN 32
#endif

// partials[g] = box of the centres of the valid boxes in group g's chunk.
// Launch: groups of RS_GROUP work-items (1 or a power of two).
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void center_bounds(
    __global const RsAabb* boxes, __global RsAabb* partials, uint count, uint chunk) {
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  RsBox sum = box_empty();
  for (uint i = begin + get_local_id(0); i < end; i += RS_GROUP) {
    const RsBox box = box_load(boxes, i);
    if (box_valid(box)) {
      RsBox center;
      center.lo = center.hi = box_center(box);
      sum = box_union(sum, center);
    }
  }
#if RS_GROUP > 1
  __local float4 lo[RS_GROUP];
  __local float4 hi[RS_GROUP];
  const uint lane = get_local_id(0);
  lo[lane] = sum.lo;
  hi[lane] = sum.hi;
  for (uint half_size = RS_GROUP / 2; half_size > 0; half_size /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_size) {
      RsBox other;
      other.lo = lo[lane + half_size];
      other.hi = hi[lane + half_size];
      sum = box_union(sum, other);
      lo[lane] = sum.lo;
      hi[lane] = sum.hi;
    }
  }
#endif
  if (get_local_id(0) == 0) box_store(sum, partials, get_group_id(0));
}

// Launch: one work-item. grid = {origin / 2 (3), cells per half unit (1)}.
__kernel void finish_center_bounds(__global const RsAabb* partials,
                                   uint count,
                                   __global float* grid) {
  RsBox sum = box_empty();
  for (uint i = 0; i < count; ++i) sum = box_union(sum, box_load(partials, i));
  const float4 extent = 0.5f * sum.hi - 0.5f * sum.lo;
  const float longest = max(extent.x, max(extent.y, extent.z));
  // longest < 2^e, so the scale 2^(21 - e) maps it below 2^21. A vanishing extent has one cell.
  const int e = (int)(as_uint(longest) >> 23) - 126;
  const bool flat = !(longest > 0x1p-100f);
  vstore3(flat ? (float3)(0.0f) : 0.5f * sum.lo.xyz, 0, grid);
  grid[3] = flat ? 0.0f : as_float((uint)(127 + 21 - e) << 23);
}

// The 21 low bits of x, two zeros after each.
inline ulong spread_bits(uint x) {
  ulong v = x & 0x1fffff;
  v = (v | v << 32) & 0x001f00000000ffffUL;
  v = (v | v << 16) & 0x001f0000ff0000ffUL;
  v = (v | v << 8) & 0x100f00f00f00f00fUL;
  v = (v | v << 4) & 0x10c30c30c30c30c3UL;
  v = (v | v << 2) & 0x1249249249249249UL;
  return v;
}

// high (31 bits), low (32 bits) = code of box i, indices[i] = i. Boxes that are not valid sort
// last. Launch: at least count work-items.
__kernel void morton_codes(__global const RsAabb* boxes,
                           __global const float* grid,
                           __global uint* high,
                           __global uint* low,
                           __global uint* indices,
                           uint count) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const RsBox box = box_load(boxes, i);
  ulong code = 0x7fffffffffffffffUL;
  if (box_valid(box)) {
    const float4 cell =
        clamp((0.5f * box_center(box) - vload4(0, grid)) * grid[3], 0.0f, 2097151.0f);
    code =
        spread_bits((uint)cell.x) << 2 | spread_bits((uint)cell.y) << 1 | spread_bits((uint)cell.z);
  }
  high[i] = (uint)(code >> 32);
  low[i] = (uint)code;
  indices[i] = i;
}

// Orders every run of equal high words by the low word (stable insertion sort). A run longer than
// RS_MAX_RUN is left alone and reported in *too_long, which the host cleared. Launch: work-items of
// `chunk` consecutive positions each; the start of a run handles it.
__kernel void sort_runs(__global const uint* high,
                        __global const uint* low,
                        __global uint* indices,
                        __global uint* too_long,
                        uint count,
                        uint chunk) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  for (uint start = begin; start < end; ++start) {
    const uint key = high[start];
    if (start + 1 >= count || high[start + 1] != key || (start > 0 && high[start - 1] == key)) {
      continue;
    }
    uint stop = start + 2;
    while (stop < count && stop - start <= RS_MAX_RUN && high[stop] == key) ++stop;
    if (stop - start > RS_MAX_RUN) {
      atomic_or(too_long, 1u);
      continue;
    }
    for (uint i = start + 1; i < stop; ++i) {
      const uint index = indices[i];
      const uint word = low[index];
      uint j = i;
      for (; j > start && low[indices[j - 1]] > word; --j) indices[j] = indices[j - 1];
      indices[j] = index;
    }
  }
}

// keys[i] = words[indices[i]]. Launch: at least count work-items.
__kernel void gather_words(__global const uint* words,
                           __global const uint* indices,
                           __global uint* keys,
                           uint count) {
  const uint i = get_global_id(0);
  if (i < count) keys[i] = words[indices[i]];
}
