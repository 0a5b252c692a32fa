// SPDX-License-Identifier: Apache-2.0
// add_exactly: adds values to one exact sum (exact_sum.h), every value by a work-item of its own,
// so that the tests see the additions alone. Any local size.
#include "trace/exact_sum.h"

__kernel void add_exactly(const uint count,
                          __global const float* restrict values,
                          const float limit,
                          __global uint* restrict words) {
  const uint i = get_global_id(0);
  if (i < count) rs_exact_add(words, values[i], limit);
}
