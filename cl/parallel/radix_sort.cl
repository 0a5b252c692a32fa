// SPDX-License-Identifier: Apache-2.0
// One pass of a stable LSD radix sort on 8 bits (Zagha and Blelloch 1991): count_digits,
// scan_counts of the table counts[digit][group], scatter. O(n) work, 3 reads and 2 writes of an
// element per pass. Between the passes key and value lie side by side (uint2): half as many places
// are written at once, so that the lines being filled stay in the first cache.
// The elements are the first min(live[0], most): the host may know only how many there are at most.
// Launch: work-groups of GROUP work-items (1 or a power of two), each walks a chunk of
// consecutive elements in order, at least `least`. GROUP = 1 is the CPU's form: few long
// sequential loops with private counters. Larger groups rank a tile of RS_ROUNDS elements a
// work-item at a time: in each round GROUP neighbouring elements set their bits in a mask per
// digit and block of work-items, and count the bits before their own. The tile is written in the
// order of its digits, so that neighbours mostly write to neighbouring addresses. 27 barriers for
// 6 GROUP elements, and 15 kB of local memory.
//   RS_SOURCE_PAIRS, RS_TARGET_PAIRS   the elements come from / go to pairs; keys and values apart
//                                      otherwise. The unused arguments may be any buffer.
#include "parallel/group_scan.h"
#include "parallel/prefetch.h"

#ifndef RS_SOURCE_PAIRS
#define RS_SOURCE_PAIRS 0
#endif
#ifndef RS_TARGET_PAIRS
#define RS_TARGET_PAIRS 1
#endif

#define RS_DIGITS 256
#define RS_DIGIT(key, shift) (((key) >> (shift)) & (RS_DIGITS - 1))

// Marks arguments that only one of both forms reads.
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
  return (max((count + groups - 1) / groups, least) + GROUP - 1) / GROUP * GROUP;
}

// counts[digit * groups + group] = how often the chunk of `group` has the digit.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void count_digits(
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
#if GROUP > 1
  __local uint table[RS_DIGITS];
  for (uint d = get_local_id(0); d < RS_DIGITS; d += GROUP) table[d] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = begin + get_local_id(0); i < end; i += GROUP) {
    atomic_inc(&table[RS_DIGIT(RS_KEY(i), shift)]);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint d = get_local_id(0); d < RS_DIGITS; d += GROUP) {
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

// Each of a digit's counts becomes the sum of those of the groups before, and totals[digit] that of
// all. Launch: a work-group per digit; of one work-item any number, which share the digits.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_counts(__global uint* counts,
                                                                             __global uint* totals,
                                                                             uint groups) {
#if GROUP > 1
  __local uint scratch[RS_SCAN_WORDS];
  const uint lane = get_local_id(0);
  __global uint* row = counts + get_group_id(0) * groups;
  uint running = 0;
  for (uint base = 0; base < groups; base += GROUP) {
    const uint i = base + lane;
    uint total;
    const uint before = group_scan(i < groups ? row[i] : 0, scratch, &total);
    if (i < groups) row[i] = running + before;
    running += total;
  }
  if (lane == 0) totals[get_group_id(0)] = running;
#else
  for (uint d = get_group_id(0); d < RS_DIGITS; d += get_num_groups(0)) {
    __global uint* row = counts + d * groups;
    uint running = 0;
    for (uint g = 0; g < groups; ++g) {
      const uint count = row[g];
      row[g] = running;
      running += count;
    }
    totals[d] = running;
  }
#endif
}

#if GROUP > RS_DIGITS
#error "GROUP is at most 256"
#elif GROUP > 1
#define RS_ROUNDS 6
#define RS_TILE (RS_ROUNDS * GROUP)
// Words that hold a bit per work-item.
#define RS_BLOCKS ((GROUP + 31) / 32)
// Digits that a work-item adds up.
#define RS_SHARE (RS_DIGITS / GROUP)

typedef struct {
  uint mask[RS_BLOCKS][RS_DIGITS];  // which work-items' elements have the digit
  ushort rank[RS_ROUNDS][GROUP];    // among the elements of the tile with the same digit
} RankMemory;

typedef union {
  RankMemory ranking;
  uint2 elements[RS_TILE];  // in the order of their digits
} TileMemory;

// How many elements of the tile with the digit of this work-item's lie before it, where a round
// takes one of every work-item; `live` when there is one. Adds the round to `count`.
uint rank_round(uint digit, bool live, __local RankMemory* memory, __local uint* count) {
  const uint lane = get_local_id(0);
  const uint block = lane / 32;
  const uint bit = 1u << lane % 32;
  if (live) atomic_or(&memory->mask[block][digit], bit);
  barrier(CLK_LOCAL_MEM_FENCE);
  uint before = 0, all = 0;
  for (uint b = 0; b < RS_BLOCKS; ++b) {
    const uint found = popcount(memory->mask[b][digit]);
    before += b < block ? found : 0;
    all += found;
  }
  const uint nearer = popcount(memory->mask[block][digit] & (bit - 1));
  before += nearer;
  const uint rank = count[digit] + before;
  barrier(CLK_LOCAL_MEM_FENCE);
  // The first one of a block cleans up, the last one of the round counts.
  if (live && nearer == 0) memory->mask[block][digit] = 0;
  if (live && before + 1 == all) count[digit] = rank + 1;
  barrier(CLK_LOCAL_MEM_FENCE);
  return rank;
}

// Each digit's count becomes the sum of the counts before it.
void find_starts(__local uint* counts, __local uint* scratch) {
  const uint first = get_local_id(0) * RS_SHARE;
  uint sum = 0, total;
  for (uint d = first; d < first + RS_SHARE; ++d) sum += counts[d];
  uint before = group_scan(sum, scratch, &total);
  for (uint d = first; d < first + RS_SHARE; ++d) {
    const uint count = counts[d];
    counts[d] = before;
    before += count;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}
#endif

// `counts` and `totals` are those of scan_counts; launched with the groups and numbers of
// count_digits.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scatter(
    RS_EITHER __global const uint* keys,
    RS_EITHER __global const uint* values,
    RS_EITHER __global const uint2* pairs,
    __global const uint* counts,
    __global const uint* totals,
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
#if GROUP > 1
  __local TileMemory tile;
  __local uint start[RS_DIGITS];  // of a digit in the tile; first, how many there are so far
  __local uint next[RS_DIGITS];   // where the group's next element of a digit goes
  __local uint scratch[RS_SCAN_WORDS];
  const uint lane = get_local_id(0);
  uint sum = 0, all;
  for (uint d = lane * RS_SHARE; d < (lane + 1) * RS_SHARE; ++d) sum += totals[d];
  uint digit_start = group_scan(sum, scratch, &all);
  for (uint d = lane * RS_SHARE; d < (lane + 1) * RS_SHARE; ++d) {
    next[d] = digit_start + counts[d * groups + group];
    digit_start += totals[d];
  }
  for (uint base = begin; base < end; base += RS_TILE) {
    const uint size = min((uint)RS_TILE, end - base);
    for (uint d = lane; d < RS_DIGITS; d += GROUP) {
      start[d] = 0;
      for (uint b = 0; b < RS_BLOCKS; ++b) tile.ranking.mask[b][d] = 0;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    uint key = lane < size ? RS_KEY(base + lane) : 0;
    // Compilers that unroll take twice the registers.
#pragma unroll 1
    for (uint r = 0; r < RS_ROUNDS; ++r) {
      const uint i = r * GROUP + lane;
      const uint following = i + GROUP < size ? RS_KEY(base + i + GROUP) : 0;
      tile.ranking.rank[r][lane] = rank_round(RS_DIGIT(key, shift), i < size, &tile.ranking, start);
      key = following;
    }
    find_starts(start, scratch);
    ushort rank[RS_ROUNDS];
#pragma unroll
    for (uint r = 0; r < RS_ROUNDS; ++r) rank[r] = tile.ranking.rank[r][lane];
    barrier(CLK_LOCAL_MEM_FENCE);  // the elements lie where the ranks were
#pragma unroll
    for (uint r = 0; r < RS_ROUNDS; ++r) {
      const uint i = r * GROUP + lane;
      if (i < size) {
        const uint2 element = RS_ELEMENT(base + i);
        tile.elements[start[RS_DIGIT(element.x, shift)] + rank[r]] = element;
      }
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint i = lane; i < size; i += GROUP) {
      const uint2 element = tile.elements[i];
      const uint digit = RS_DIGIT(element.x, shift);
      const uint target = next[digit] + (i - start[digit]);
      RS_STORE(element, target);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint d = lane; d < RS_DIGITS; d += GROUP) {
      next[d] += (d + 1 < RS_DIGITS ? start[d + 1] : size) - start[d];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
#else
  if (begin >= end) return;
  if (totals[RS_DIGIT(RS_KEY(begin), shift)] == count) {
    // Every key has this digit: nothing moves.
    for (uint i = begin; i < end; ++i) {
      RS_STORE(RS_ELEMENT(i), i);
    }
    return;
  }
  uint next[RS_DIGITS];
  uint digit_start = 0;
  for (uint d = 0; d < RS_DIGITS; ++d) {
    next[d] = digit_start + counts[d * groups + group];
    digit_start += totals[d];
  }
  for (uint i = begin; i < end; ++i) {
    const uint2 element = RS_ELEMENT(i);
    const uint target = next[RS_DIGIT(element.x, shift)]++;
    RS_PREPARE(target);
    RS_STORE(element, target);
  }
#endif
}
