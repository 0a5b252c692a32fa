// SPDX-License-Identifier: Apache-2.0
// Sums of gradients of several views: sum[i] = first[i] + second[i] for i < count; sum may be one
// of them. Launch: one work-item per number. Complexity: O(1) each.

__kernel void add_numbers(const __global float* first,
                          const __global float* second,
                          __global float* sum,
                          ulong count) {
  const size_t i = get_global_id(0);
  if (i < count) sum[i] = first[i] + second[i];
}
