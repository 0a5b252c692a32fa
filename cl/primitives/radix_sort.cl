// SPDX-License-Identifier: Apache-2.0
// One pass of a stable LSD radix sort on 8 bits (Zagha and Blelloch 1991): count_digits, an
// exclusive scan of the table counts[digit][group], scatter. O(n) work, 3 reads and 2 writes of an
// element per pass. Between the passes key and value lie side by side (uint2): half as many places
// are written at once, so that the lines being filled stay in the first cache.
// The elements are the first min(live[0], most): the host may know only how many there are at most.
// Launch: work-groups of RS_GROUP work-items (1 or a power of two), each walks a chunk of
// consecutive elements in order, at least `least`. RS_GROUP = 1 is the CPU's form: few long
// sequential loops with private counters. Larger groups rank a tile of RS_GROUP elements at a time
// by eight stable one-bit splits in local memory (Satish et al. 2009).
//   RS_SOURCE_PAIRS, RS_TARGET_PAIRS   the elements come from / go to pairs; keys and values apart
//                                      otherwise. The unused arguments may be any buffer.
#include "primitives/group_scan.h"
#include "primitives/prefetch.h"

#ifndef RS_SOURCE_PAIRS
#define RS_SOURCE_PAIRS 0
#endif
#ifndef RS_TARGET_PAIRS
#define RS_TARGET_PAIRS 1
#endif

#define RS_DIGITS 256
#define RS_DIGIT(key, shift) (((key) >> (shift)) & (RS_DIGITS - 1))

// On the arguments of both forms.
#define RS_EITHER __attribute__((unused))

#if RS_SOURCE_PAIRS
#define RS_KEY(i) pairs[i].x
#define RS_ELEMENT(i) pairs[i]
#else
#define RS_KEY(i) keys[i]
#define RS_ELEMENT(i) (uint2)(keys[i], values[i])
#endif

// A line ahead of where the digit's next elements go.
#if RS_TARGET_PAIRS
#define RS_STORE(element, i) pairs_out[i] = (element)
#define RS_PREPARE(i) RS_PREFETCH_WRITE(pairs_out + (i) + 8)
#else
#define RS_STORE(element, i) \
  keys_out[i] = (element).x; \
  values_out[i] = (element).y
#define RS_PREPARE(i)                     \
  RS_PREFETCH_WRITE(keys_out + (i) + 16); \
  RS_PREFETCH_WRITE(values_out + (i) + 16)
#endif

// Elements of a group.
uint chunk_size(uint count, uint groups, uint least) {
  return (max((count + groups - 1) / groups, least) + RS_GROUP - 1) / RS_GROUP * RS_GROUP;
}

// counts[digit * groups + group] = how often the chunk of `group` has the digit.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void count_digits(
    RS_EITHER __global const uint* keys,
    RS_EITHER __global const uint2* pairs,
    __global uint* counts,
    __global const uint* live,
    uint most,
    uint least,
    uint shift) {
  const uint group = get_group_id(0);
  const uint groups = get_num_groups(0);
  const uint count = min(live[0], most);
  const uint chunk = chunk_size(count, groups, least);
  const uint begin = min(group * chunk, count);
  const uint end = min(begin + chunk, count);
#if RS_GROUP > 1
  __local uint table[RS_DIGITS];
  for (uint d = get_local_id(0); d < RS_DIGITS; d += RS_GROUP) table[d] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = begin + get_local_id(0); i < end; i += RS_GROUP) {
    atomic_inc(&table[RS_DIGIT(RS_KEY(i), shift)]);
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
    const uint4 key = (uint4)(RS_KEY(i), RS_KEY(i + 1), RS_KEY(i + 2), RS_KEY(i + 3));
    const uint4 digit = RS_DIGIT(key, shift);
    ++table[0][digit.x];
    ++table[1][digit.y];
    ++table[2][digit.z];
    ++table[3][digit.w];
  }
  for (; i < end; ++i) ++table[0][RS_DIGIT(RS_KEY(i), shift)];
  for (uint d = 0; d < RS_DIGITS; ++d) {
    counts[d * groups + group] = table[0][d] + table[1][d] + table[2][d] + table[3][d];
  }
#endif
}

// `offsets` is the scanned table of count_digits, launched with the same groups and numbers,
// with the total behind it.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void scatter(
    RS_EITHER __global const uint* keys,
    RS_EITHER __global const uint* values,
    RS_EITHER __global const uint2* pairs,
    __global const uint* offsets,
    RS_EITHER __global uint* keys_out,
    RS_EITHER __global uint* values_out,
    RS_EITHER __global uint2* pairs_out,
    __global const uint* live,
    uint most,
    uint least,
    uint shift) {
  const uint group = get_group_id(0);
  const uint groups = get_num_groups(0);
  const uint count = min(live[0], most);
  const uint chunk = chunk_size(count, groups, least);
  const uint begin = min(group * chunk, count);
  const uint end = min(begin + chunk, count);
#if RS_GROUP > 1
  __local uint next[RS_DIGITS];
  __local uint start[RS_DIGITS];
  __local uint2 tile[RS_GROUP];
  __local uint scratch[RS_GROUP];
  const uint lane = get_local_id(0);
  for (uint d = lane; d < RS_DIGITS; d += RS_GROUP) next[d] = offsets[d * groups + group];
  for (uint base = begin; base < end; base += RS_GROUP) {
    const uint size = min((uint)RS_GROUP, end - base);
    // Padding has the largest digit and comes last, so that it stays behind the tile's elements.
    uint2 element = (uint2)(0xffffffffu, 0);
    if (lane < size) element = RS_ELEMENT(base + lane);
    for (uint bit = shift; bit < shift + 8; ++bit) {
      const uint one = (element.x >> bit) & 1;
      uint zeros;
      const uint zeros_before = group_scan(1 - one, scratch, &zeros);
      tile[one ? zeros + lane - zeros_before : zeros_before] = element;
      barrier(CLK_LOCAL_MEM_FENCE);
      element = tile[lane];
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    const uint digit = RS_DIGIT(element.x, shift);
    scratch[lane] = digit;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane == 0 || scratch[lane - 1] != digit) start[digit] = lane;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint rank = lane - start[digit];
    if (lane < size) {
      const uint target = next[digit] + rank;
      RS_STORE(element, target);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < size && (lane == size - 1 || scratch[lane + 1] != digit)) next[digit] += rank + 1;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
#else
  if (begin >= end) return;
  const uint first = RS_DIGIT(RS_KEY(begin), shift);
  if (offsets[first * groups] == 0 && offsets[(first + 1) * groups] == count) {
    // Every key has this digit: nothing moves.
    for (uint i = begin; i < end; ++i) {
      RS_STORE(RS_ELEMENT(i), i);
    }
    return;
  }
  uint next[RS_DIGITS];
  for (uint d = 0; d < RS_DIGITS; ++d) next[d] = offsets[d * groups + group];
  for (uint i = begin; i < end; ++i) {
    const uint2 element = RS_ELEMENT(i);
    const uint target = next[RS_DIGIT(element.x, shift)]++;
    RS_PREPARE(target);
    RS_STORE(element, target);
  }
#endif
}
