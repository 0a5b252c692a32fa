// SPDX-License-Identifier: Apache-2.0
// Sums of gradients of several views, and counts of theirs.
// add_numbers: sum[i] = first[i] + second[i] for i < count; sum may be one of them. One work-item
//   per number.
// add_count: sum += count, 64-bit counts in two words, the lower first. One work-item.
// Complexity: O(1) each.

__kernel void add_numbers(const __global float* first,
                          const __global float* second,
                          __global float* sum,
                          ulong count) {
  const size_t i = get_global_id(0);
  if (i < count) sum[i] = first[i] + second[i];
}

__kernel void add_count(const __global uint* count, __global uint* sum) {
  const uint low = sum[0] + count[0];
  sum[1] += count[1] + (low < count[0] ? 1u : 0u);
  sum[0] = low;
}
