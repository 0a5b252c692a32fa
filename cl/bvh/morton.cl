// SPDX-License-Identifier: Apache-2.0
// Morton order of boxes: bounds of the centres (center_bounds, then choose_grid), 64-bit codes of
// the centres (morton_codes), and the repair of short runs of equal high words after a sort by the
// high word alone (sort_runs). All O(n). Codes: Morton 1966, as used by Lauterbach et al. 2009.
//
// A grid has one cell size for all axes, a power of two: codes are exact and equal on every device,
// and the longest axis is split first. A few boxes far away would leave the others in few cells.
// choose_grid therefore looks for a window that holds all but the tails of a sample; where it is
// much smaller than the whole it gets a grid of its own, and the boxes outside get codes behind all
// others (bit 63) on a coarse grid around the middle of the window: their first split is by
// octants, so that few of their nodes cover the window.
#include "bvh/box.h"

#ifndef RS_GROUP
#define RS_GROUP 1
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

// The power of two, as a float, by which lengths up to `longest` become less than 2^bits; 0 where
// there is no extent to divide.
inline float grid_scale(float longest, int bits) {
  const int e = (int)(as_uint(longest) >> 23) - 126;  // longest < 2^e
  return longest > 0x1p-100f ? as_float((uint)(127 + bits - e) << 23) : 0.0f;
}

inline float longest_side(RsBox box) {
  const float4 side = box.hi - box.lo;
  return max(side.x, max(side.y, side.z));
}

// All lengths are halves of the true ones, which cannot overflow. grid = {origin (3), cells per
// unit} of the window, {origin in the middle (3), cells per unit} of what is outside, the window's
// lower and upper corner (3 and 3).
// Launch: one group of RS_GROUP work-items.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void choose_grid(
    __global const RsAabb* boxes,
    __global const RsAabb* partials,
    uint count,
    uint groups,
    __global float* grid) {
  __local uint bins[3][RS_BINS];
  const uint lane = get_local_id(0);
  RsBox whole = box_empty();
  for (uint i = 0; i < groups; ++i) whole = box_union(whole, box_load(partials, i));
  whole.lo *= 0.5f;
  whole.hi *= 0.5f;
  RsBox window = whole;
  const uint sample = min(count, (uint)RS_SAMPLE);
  for (int round = 0; round < RS_ROUNDS; ++round) {
    const float longest = longest_side(window);
    const float scale = grid_scale(longest, 6);
    if (!(scale > 0.0f)) break;
    for (uint bin = lane; bin < 3 * RS_BINS; bin += RS_GROUP)
      bins[bin / RS_BINS][bin % RS_BINS] = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = lane; i < sample; i += RS_GROUP) {
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

// The 10 low bits of x, two zeros after each.
inline uint spread_bits(uint x) {
  x &= 0x3ff;
  x = (x | x << 16) & 0x030000ff;
  x = (x | x << 8) & 0x0300f00f;
  x = (x | x << 4) & 0x030c30c3;
  x = (x | x << 2) & 0x09249249;
  return x;
}

// Bits first..first + 9 of three coordinates in turn.
inline uint interleave(uint x, uint y, uint z, int first) {
  return spread_bits(x >> first) << 2 | spread_bits(y >> first) << 1 | spread_bits(z >> first);
}

inline uint grid_cell(float half_center, float origin, float scale, float first, float last) {
  const float cell = (half_center - origin) * scale + first;
  return (uint)(cell > 0.0f ? (cell < last ? cell : last) : 0.0f);
}

inline float half_center(float lo, float hi) { return 0.5f * (0.5f * lo + 0.5f * hi); }

inline int finite_interval(float lo, float hi) {
  return (lo <= hi) & (lo >= -FLT_MAX) & (hi <= FLT_MAX);
}

// high, low (32 bits each) = code of box i, indices[i] = i. Boxes that are not valid sort last.
// Launch: work-items of `chunk` consecutive boxes each; without branches and in 32-bit words, so
// that compilers make vectors of the loop.
__kernel void morton_codes(__global const float* restrict boxes,
                           __global const float* restrict grid,
                           __global uint* restrict high,
                           __global uint* restrict low,
                           __global uint* restrict indices,
                           uint count,
                           uint chunk) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  const float4 fine = vload4(0, grid);
  const float4 coarse = vload4(1, grid);
  const float3 lo = vload3(0, grid + 8);
  const float3 hi = vload3(0, grid + 11);
  for (uint i = begin; i < end; ++i) {
    __global const float* box = boxes + 6 * (size_t)i;
    const int valid = finite_interval(box[0], box[3]) & finite_interval(box[1], box[4]) &
                      finite_interval(box[2], box[5]);
    const float cx = half_center(box[0], box[3]);
    const float cy = half_center(box[1], box[4]);
    const float cz = half_center(box[2], box[5]);
    const bool inside =
        (cx >= lo.x) & (cx <= hi.x) & (cy >= lo.y) & (cy <= hi.y) & (cz >= lo.z) & (cz <= hi.z);
    const float scale = inside ? fine.w : coarse.w;
    const float first = inside ? 0.0f : 1048576.0f;
    // The last cell of the coarse grid is left to boxes that are not valid.
    const float last = inside ? 2097151.0f : 2097150.0f;
    const uint x = grid_cell(cx, inside ? fine.x : coarse.x, scale, first, last);
    const uint y = grid_cell(cy, inside ? fine.y : coarse.y, scale, first, last);
    const uint z = grid_cell(cz, inside ? fine.z : coarse.z, scale, first, last);
    // 63 bits: three of bit 20, thirty of bits 10..19, thirty of bits 0..9.
    const uint top = (x >> 20) << 2 | (y >> 20) << 1 | z >> 20;
    const uint middle = interleave(x, y, z, 10);
    const uint bottom = interleave(x, y, z, 0);
    const uint outside = inside ? 0u : 0x80000000u;
    high[i] = valid ? outside | top << 28 | middle >> 2 : 0xffffffffu;
    low[i] = valid ? middle << 30 | bottom : 0xffffffffu;
    indices[i] = i;
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
