// SPDX-License-Identifier: Apache-2.0
// Sums of gradients of several views.

#include "trace/arguments.h"
#include "train/parameter_groups.h"

// Adds the gradients of one view, or of several, to others: of all parameters of `count` Gaussians,
// and what density control reads, `met`, which is as wide as the means. Launch: a work-item for
// each float of the parameters, in groups as `parts` says. Complexity: O(1) each.
__kernel void add_gradients(uint count,
                            const RsParts parts,
                            RS_GAUSSIAN_ARGUMENTS,
                            __global const float* restrict met,
                            RS_GRADIENT_ARGUMENTS) {
#define RS_ADD(number, name, width, place)                 \
  if (rs_works_on(parts, number)) {                        \
    const size_t i = rs_item_of(parts, number);            \
    if (i < (size_t)count * width) g_##name[i] += name[i]; \
  }
  RS_EACH_PARAMETER_GROUP(RS_ADD)
  const size_t i = rs_item_of(parts, 0);
  if (rs_works_on(parts, 0) && i < 3 * (size_t)count) screen[i] += met[i];
}

// sum[i] += numbers[i] for i < count. Launch: one work-item per number. Complexity: O(1) each.
__kernel void add_numbers(const __global float* numbers, __global float* sum, ulong count) {
  const size_t i = get_global_id(0);
  if (i < count) sum[i] += numbers[i];
}
