// SPDX-License-Identifier: Apache-2.0
// Sums of gradients of several views.

#include "train/parameter_groups.h"

// Adds those of one view, or of several, to others: of all parameters of `count` Gaussians, and
// what density control counts, as wide as the means. Launch: a work-item for each float of the
// parameters, in groups as `parts` says. Complexity: O(1) each.
__kernel void add_gradients(uint count,
                            const RsParts parts,
                            const __global float* means,
                            const __global float* quaternions,
                            const __global float* scales,
                            const __global float* opacities,
                            const __global float* sh,
                            const __global float* screen,
                            __global float* sum_means,
                            __global float* sum_quaternions,
                            __global float* sum_scales,
                            __global float* sum_opacities,
                            __global float* sum_sh,
                            __global float* sum_screen) {
#define RS_ADD(number, name, width, place)                   \
  if (rs_works_on(parts, number)) {                          \
    const size_t i = rs_item_of(parts, number);              \
    if (i < (size_t)count * width) sum_##name[i] += name[i]; \
  }
  RS_EACH_PARAMETER_GROUP(RS_ADD)
  RS_ADD(0, screen, 3, 0)
}

// sum[i] += numbers[i] for i < count. Launch: one work-item per number. Complexity: O(1) each.
__kernel void add_numbers(const __global float* numbers, __global float* sum, ulong count) {
  const size_t i = get_global_id(0);
  if (i < count) sum[i] += numbers[i];
}
