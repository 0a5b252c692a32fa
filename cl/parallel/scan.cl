// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum, reduce-then-scan (Merrill and Grimshaw 2009): sum_chunks, then scan_values,
// each group of which adds up the sums of the chunks before its own: they are few, and a launch for
// them would take longer. Launch: work-groups of GROUP work-items (a power of two), each walks
// `chunk` consecutive elements. GROUP = 1 is the CPU's form: few long sequential loops. Sums stop
// at 2^32 - 1, so that a caller can tell. Reads 2 n and writes n elements.
#include "parallel/group_scan.h"

// sums[g] = sum of the elements of group g's chunk.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void sum_chunks(
    __global const uint* values, __global uint* sums, uint count, uint chunk) {
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  uint sum = 0;
  for (uint i = begin + get_local_id(0); i < end; i += GROUP) sum = add_sat(sum, values[i]);
#if GROUP > 1
  __local uint scratch[RS_SCAN_WORDS];
  uint total;
  group_scan(sum, scratch, &total);
  sum = total;
#endif
  if (get_local_id(0) == 0) sums[get_group_id(0)] = sum;
}

// Scans the values in place; `sums` are those of sum_chunks (not read where there is one group).
// The last group writes the total behind the values.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void scan_values(
    __global uint* values, __global const uint* sums, uint count, uint chunk) {
  const uint group = get_group_id(0);
  const uint begin = min(group * chunk, count);
  const uint end = min(begin + chunk, count);
  uint running = 0;
#if GROUP > 1
  __local uint scratch[RS_SCAN_WORDS];
  const uint lane = get_local_id(0);
  uint mine = 0;
  for (uint g = lane; g < group; g += GROUP) mine = add_sat(mine, sums[g]);
  group_scan(mine, scratch, &running);
  for (uint base = begin; base < end; base += GROUP) {
    const uint i = base + lane;
    uint total;
    const uint before = group_scan(i < end ? values[i] : 0, scratch, &total);
    if (i < end) values[i] = add_sat(running, before);
    running = add_sat(running, total);
  }
#else
  for (uint g = 0; g < group; ++g) running = add_sat(running, sums[g]);
  for (uint i = begin; i < end; ++i) {
    const uint value = values[i];
    values[i] = running;
    running = add_sat(running, value);
  }
#endif
  if (group == get_num_groups(0) - 1 && get_local_id(0) == 0) values[count] = running;
}
