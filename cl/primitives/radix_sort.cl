// SPDX-License-Identifier: Apache-2.0
// One pass of a stable LSD radix sort on 8 bits (Zagha and Blelloch 1991): count_digits, an
// exclusive scan of the table counts[digit][group], scatter_pairs. O(n) work, 3 reads and 2 writes
// of an element per pass. Launch: work-groups of RS_GROUP work-items (1 or a power of two), each
// walks `chunk` consecutive elements in order. RS_GROUP = 1 is the CPU's form: few long sequential
// loops with private counters. Larger groups rank a tile of RS_GROUP elements at a time by eight
// stable one-bit splits in local memory (Satish et al. 2009).
#include "primitives/group_scan.h"

#define RS_DIGITS 256

// counts[digit * groups + group] = how often the chunk of `group` has the digit.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void count_digits(
    __global const uint* keys, __global uint* counts, uint count, uint chunk, uint shift) {
  const uint group = get_group_id(0);
  const uint groups = get_num_groups(0);
  const uint begin = min(group * chunk, count);
  const uint end = min(begin + chunk, count);
#if RS_GROUP > 1
  __local uint table[RS_DIGITS];
  for (uint d = get_local_id(0); d < RS_DIGITS; d += RS_GROUP) table[d] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = begin + get_local_id(0); i < end; i += RS_GROUP) {
    atomic_inc(&table[(keys[i] >> shift) & (RS_DIGITS - 1)]);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint d = get_local_id(0); d < RS_DIGITS; d += RS_GROUP) {
    counts[d * groups + group] = table[d];
  }
#else
  // Four tables: equal digits in a row would wait for one another's store otherwise.
  uint table[4][RS_DIGITS];
  for (uint d = 0; d < RS_DIGITS; ++d) table[0][d] = table[1][d] = table[2][d] = table[3][d] = 0;
  uint i = begin;
  for (; i + 4 <= end; i += 4) {
    const uint4 digit = (vload4(0, keys + i) >> shift) & (uint4)(RS_DIGITS - 1);
    ++table[0][digit.x];
    ++table[1][digit.y];
    ++table[2][digit.z];
    ++table[3][digit.w];
  }
  for (; i < end; ++i) ++table[0][(keys[i] >> shift) & (RS_DIGITS - 1)];
  for (uint d = 0; d < RS_DIGITS; ++d) {
    counts[d * groups + group] = table[0][d] + table[1][d] + table[2][d] + table[3][d];
  }
#endif
}

// `offsets` is the scanned table of count_digits, launched with the same groups and chunk.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void scatter_pairs(
    __global const uint* keys,
    __global const uint* values,
    __global const uint* offsets,
    __global uint* keys_out,
    __global uint* values_out,
    uint count,
    uint chunk,
    uint shift) {
  const uint group = get_group_id(0);
  const uint groups = get_num_groups(0);
  const uint begin = min(group * chunk, count);
  const uint end = min(begin + chunk, count);
#if RS_GROUP > 1
  __local uint next[RS_DIGITS];
  __local uint start[RS_DIGITS];
  __local uint tile_keys[RS_GROUP];
  __local uint tile_values[RS_GROUP];
  __local uint scratch[RS_GROUP];
  const uint lane = get_local_id(0);
  for (uint d = lane; d < RS_DIGITS; d += RS_GROUP) next[d] = offsets[d * groups + group];
  for (uint base = begin; base < end; base += RS_GROUP) {
    const uint size = min((uint)RS_GROUP, end - base);
    // Padding has the largest digit and comes last, so that it stays behind the tile's elements.
    uint key = lane < size ? keys[base + lane] : 0xffffffffu;
    uint value = lane < size ? values[base + lane] : 0;
    for (uint bit = shift; bit < shift + 8; ++bit) {
      const uint one = (key >> bit) & 1;
      uint zeros;
      const uint zeros_before = group_scan(1 - one, scratch, &zeros);
      const uint rank = one ? zeros + lane - zeros_before : zeros_before;
      tile_keys[rank] = key;
      tile_values[rank] = value;
      barrier(CLK_LOCAL_MEM_FENCE);
      key = tile_keys[lane];
      value = tile_values[lane];
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    const uint digit = (key >> shift) & (RS_DIGITS - 1);
    scratch[lane] = digit;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0 || scratch[lane - 1] != digit) start[digit] = lane;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint rank = lane - start[digit];
    if (lane < size) {
      const uint target = next[digit] + rank;
      keys_out[target] = key;
      values_out[target] = value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < size && (lane == size - 1 || scratch[lane + 1] != digit)) next[digit] += rank + 1;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
#else
  uint next[RS_DIGITS];
  for (uint d = 0; d < RS_DIGITS; ++d) next[d] = offsets[d * groups + group];
  for (uint i = begin; i < end; ++i) {
    const uint key = keys[i];
    const uint target = next[(key >> shift) & (RS_DIGITS - 1)]++;
    keys_out[target] = key;
    values_out[target] = values[i];
  }
#endif
}
