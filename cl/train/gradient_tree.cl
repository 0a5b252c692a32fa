// SPDX-License-Identifier: Apache-2.0
// Sums of gradients of several views.

#include "trace/arguments.h"
#include "train/parameter_groups.h"

#define RS_TO(name) g_##name

// Adds the gradients of one view, or of several, to others: of all parameters of `count` Gaussians,
// and what density control reads, `met`, which is as wide as the quaternions. Launch: a work-item for
// each float of the parameters, in groups as `parts` says. Complexity: O(1) each.
__kernel void add_gradients(uint count,
                            const RsParts parts,
                            RS_GAUSSIAN_ARGUMENTS,
                            __global const float* restrict met,
                            RS_GRADIENT_ARGUMENTS) {
  const __global float* from = means;
  __global float* to = RS_TO(means);
  size_t i = 0, end = 0;
  RS_EACH_PARAMETER_GROUP(RS_CHOOSE_ARRAYS)
  if (i < end) to[i] += from[i];
  if (rs_works_on(parts, 1) && i < end) screen[i] += met[i];
}

// sum[i] += numbers[i] for i < count. Launch: one work-item per number. Complexity: O(1) each.
__kernel void add_numbers(const __global float* numbers, __global float* sum, ulong count) {
  const size_t i = get_global_id(0);
  if (i < count) sum[i] += numbers[i];
}
