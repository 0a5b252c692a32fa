// SPDX-License-Identifier: Apache-2.0
// Order of boxes along a Hilbert curve: bounds of the centres (center_bounds, then choose_grid),
// 64-bit codes of the centres (curve_codes), and the repair of short runs of equal high words after
// a sort by the high word alone (sort_runs). All O(n). Codes by transposed axes: Skilling 2004.
//
// A grid has one cell size for all axes, a power of two: the curve keeps its shape, and codes are
// exact and equal on every device. A few boxes far away would leave the others in few cells.
// choose_grid therefore looks for a window that holds all but the tails of a sample; where it is
// much smaller than the whole it gets a grid of its own, and the boxes outside get codes behind all
// others (bit 63) on a coarse grid around the middle of the window: their first split is by
// octants, so that few of their nodes cover the window.
#include "bvh/box.h"
#include "parallel/vector_lanes.h"

#ifndef GROUP
#define GROUP 1
#endif
#ifndef RS_MAX_RUN
#define RS_MAX_RUN 32
#endif

// The sample: at most so many boxes, equally spaced; one in RS_TAIL may lie beyond each side.
#define RS_SAMPLE 2048
#define RS_TAIL 256
// Bins per axis and round. Rounds end when one does not halve the window.
#define RS_BINS 64
#define RS_ROUNDS 32
// A window is used when it is smaller than the whole by this factor.
#define RS_MIN_GAIN 16.0f
// Bits per axis of a code.
#define RS_CODE_BITS 21

// Union over the work-items of a group, the same for all of them; `scratch` holds 2 GROUP.
RsBox group_union(RsBox own, __local float4* scratch) {
#if GROUP > 1
  const uint lane = get_local_id(0);
  scratch[2 * lane] = own.lo;
  scratch[2 * lane + 1] = own.hi;
  for (uint half_size = GROUP / 2; half_size > 0; half_size /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_size) {
      RsBox other;
      other.lo = scratch[2 * (lane + half_size)];
      other.hi = scratch[2 * (lane + half_size) + 1];
      own = box_union(own, other);
      scratch[2 * lane] = own.lo;
      scratch[2 * lane + 1] = own.hi;
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  own.lo = scratch[0];
  own.hi = scratch[1];
#else
  (void)scratch;
#endif
  return own;
}

// partials[g] = box of the centres of the valid boxes in group g's chunk.
// Launch: groups of GROUP work-items (1 or a power of two).
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void center_bounds(
    __global const RsAabb* boxes, __global RsAabb* partials, uint count, uint chunk) {
  __local float4 scratch[2 * GROUP];
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  RsBox sum = box_empty();
  for (uint i = begin + get_local_id(0); i < end; i += GROUP) {
    const RsBox box = box_load(boxes, i);
    if (box_valid(box)) {
      RsBox center;
      center.lo = center.hi = box_center(box);
      sum = box_union(sum, center);
    }
  }
  sum = group_union(sum, scratch);
  if (get_local_id(0) == 0) box_store(sum, partials, get_group_id(0));
}

// The power of two, as a float, by which lengths up to `longest` become less than 2^bits; 0 where
// there is no extent to divide.
float grid_scale(float longest, int bits) {
  const int e = (int)(as_uint(longest) >> 23) - 126;  // longest < 2^e
  return longest > 0x1p-100f ? as_float((uint)(127 + bits - e) << 23) : 0.0f;
}

float longest_side(RsBox box) {
  const float4 side = box.hi - box.lo;
  return max(side.x, max(side.y, side.z));
}

// All lengths are halves of the true ones, which cannot overflow. grid = {origin (3), cells per
// unit} of the window, {origin in the middle (3), cells per unit} of what is outside, the window's
// lower and upper corner (3 and 3).
// Launch: one group of GROUP work-items, which share the partial boxes and the sample.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void choose_grid(
    __global const RsAabb* boxes,
    __global const RsAabb* partials,
    uint count,
    uint groups,
    __global float* grid) {
  __local uint bins[3][RS_BINS];
  __local float4 scratch[2 * GROUP];
  const uint lane = get_local_id(0);
  RsBox whole = box_empty();
  for (uint i = lane; i < groups; i += GROUP) whole = box_union(whole, box_load(partials, i));
  whole = group_union(whole, scratch);
  whole.lo *= 0.5f;
  whole.hi *= 0.5f;
  RsBox window = whole;
  const uint sample = min(count, (uint)RS_SAMPLE);
  for (int round = 0; round < RS_ROUNDS; ++round) {
    const float longest = longest_side(window);
    const float scale = grid_scale(longest, 6);
    if (!(scale > 0.0f)) break;
    for (uint bin = lane; bin < 3 * RS_BINS; bin += GROUP) bins[bin / RS_BINS][bin % RS_BINS] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = lane; i < sample; i += GROUP) {
      const RsBox box = box_load(boxes, (size_t)((ulong)i * count / sample));
      if (!box_valid(box)) continue;
      const float4 bin = clamp((0.5f * box_center(box) - window.lo) * scale, 0.0f, RS_BINS - 1.0f);
      atomic_inc(&bins[0][(uint)bin.x]);
      atomic_inc(&bins[1][(uint)bin.y]);
      atomic_inc(&bins[2][(uint)bin.z]);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    // Every work-item reads the bins and finds the same window.
    float lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      uint total = 0;
      for (int bin = 0; bin < RS_BINS; ++bin) total += bins[axis][bin];
      int first = 0;
      for (uint below = bins[axis][0]; below <= total / RS_TAIL && first + 1 < RS_BINS;) {
        below += bins[axis][++first];
      }
      int last = RS_BINS - 1;
      for (uint above = bins[axis][last]; above <= total / RS_TAIL && last > first;) {
        above += bins[axis][--last];
      }
      // One bin more on either side: a centre's bin is rounded.
      lo[axis] = max(first - 1, 0) / scale;
      hi[axis] = min(last + 2, RS_BINS) / scale;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    RsBox next;
    next.lo = window.lo + (float4)(lo[0], lo[1], lo[2], 0.0f);
    next.hi = window.lo + (float4)(hi[0], hi[1], hi[2], 0.0f);
    next.hi = next.hi < window.hi ? next.hi : window.hi;
    window = next;
    if (longest_side(window) * 2.0f > longest) break;
  }
  // The tails of what was found belong to it: half its size on every side.
  const float margin = 0.5f * longest_side(window);
  RsBox wide;
  wide.lo = window.lo - margin;
  wide.hi = window.hi + margin;
  wide.lo = wide.lo > whole.lo ? wide.lo : whole.lo;
  wide.hi = wide.hi < whole.hi ? wide.hi : whole.hi;
  window = longest_side(wide) * RS_MIN_GAIN < longest_side(whole) ? wide : whole;
  if (lane == 0) {
    const float scale = grid_scale(longest_side(window), 21);
    vstore3(scale > 0.0f ? window.lo.xyz : (float3)(0.0f), 0, grid);
    grid[3] = scale;
    const float4 center = 0.5f * window.lo + 0.5f * window.hi;
    const float4 below = center - whole.lo;
    const float4 above = whole.hi - center;
    RsBox reach;
    reach.lo = (float4)(0.0f);
    reach.hi = below > above ? below : above;
    vstore3(center.xyz, 0, grid + 4);
    grid[7] = grid_scale(longest_side(reach), 20);
    vstore3(window.lo.xyz, 0, grid + 8);
    vstore3(window.hi.xyz, 0, grid + 11);
  }
}

// The 21 low bits of x, two zeros after each.
ulong spread_bits(uint x) {
  ulong v = x & 0x1fffff;
  v = (v | v << 32) & 0x001f00000000ffffUL;
  v = (v | v << 16) & 0x001f0000ff0000ffUL;
  v = (v | v << 8) & 0x100f00f00f00f00fUL;
  v = (v | v << 4) & 0x10c30c30c30c30c3UL;
  v = (v | v << 2) & 0x1249249249249249UL;
  return v;
}

// high, low (32 bits each) = code of box i, indices[i] = i. Boxes that are not valid sort last.
// Launch: at least ceil(count / LANES) work-items, LANES boxes each.
__kernel void curve_codes(__global const RsAabb* boxes,
                          __global const float* grid,
                          __global uint* high,
                          __global uint* low,
                          __global uint* indices,
                          const uint count) {
  const uint begin = (uint)get_global_id(0) * LANES;
  if (begin >= count) return;
  const uint size = min((uint)LANES, count - begin);
  const float4 fine = vload4(0, grid);
  const float4 coarse = vload4(1, grid);
  const float4 lo = (float4)(vload3(0, grid + 8), -FLT_MAX);
  const float4 hi = (float4)(vload3(0, grid + 11), FLT_MAX);
  union {
    iv v[3];
    int s[3][LANES];
  } cell;
  bool valid[LANES], inside[LANES];
  for (uint k = 0; k < LANES; ++k) {
    const RsBox box = box_load(boxes, begin + min(k, size - 1));
    valid[k] = box_valid(box);
    const float4 center = 0.5f * box_center(box);
    inside[k] = all(center >= lo && center <= hi);
    // The last cells of the coarse grid are left to boxes that are not valid.
    const float4 at = inside[k]
                          ? clamp((center - fine) * fine.w, 0.0f, 2097151.0f)
                          : clamp((center - coarse) * coarse.w + 1048576.0f, 0.0f, 2097150.0f);
    cell.s[0][k] = valid[k] ? (int)at.x : 0;
    cell.s[1][k] = valid[k] ? (int)at.y : 0;
    cell.s[2][k] = valid[k] ? (int)at.z : 0;
  }
  iv x = cell.v[0], y = cell.v[1], z = cell.v[2];
  for (int bit = 1 << (RS_CODE_BITS - 1); bit > 1; bit >>= 1) {
    const iv low_bits = (iv)(bit - 1);
    x ^= low_bits & RS_MASK((x & bit) != 0);
    const iv flip_y = RS_MASK((y & bit) != 0);
    iv swap = (x ^ y) & low_bits & ~flip_y;
    x ^= (low_bits & flip_y) | swap;
    y ^= swap;
    const iv flip_z = RS_MASK((z & bit) != 0);
    swap = (x ^ z) & low_bits & ~flip_z;
    x ^= (low_bits & flip_z) | swap;
    z ^= swap;
  }
  y ^= x;
  z ^= y;
  iv parity = (iv)(0);
  for (int bit = 1 << (RS_CODE_BITS - 1); bit > 1; bit >>= 1) {
    parity ^= (iv)(bit - 1) & RS_MASK((z & bit) != 0);
  }
  cell.v[0] = x ^ parity;
  cell.v[1] = y ^ parity;
  cell.v[2] = z ^ parity;
  for (uint k = 0; k < size; ++k) {
    const ulong code =
        spread_bits(cell.s[0][k]) << 2 | spread_bits(cell.s[1][k]) << 1 | spread_bits(cell.s[2][k]);
    const uint outside = inside[k] ? 0u : 0x80000000u;
    high[begin + k] = valid[k] ? outside | (uint)(code >> 32) : 0xffffffffu;
    low[begin + k] = valid[k] ? (uint)code : 0xffffffffu;
    indices[begin + k] = begin + k;
  }
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
