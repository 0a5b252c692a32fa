// SPDX-License-Identifier: Apache-2.0
// What a training step found of its photo, kept on the device until somebody asks.
//   partials: sums of the loss, {pixel term, squared error, weight, 0}
//   fit: per view RS_FIT_ITEMS pairs of squared error and weight
// Launch: RS_FIT_ITEMS work-items, which walk the partial sums. A step whose view had no room
// (`overflow`) says nothing.
#include "shared/train_layout.h"

__kernel void note_fit(const __global float4* partials,
                       const int sums,
                       const __global uint* overflow,
                       const uint view,
                       __global float2* fit) {
  const int item = get_global_id(0);
  if (overflow[0] != 0) return;
  float2 sum = (float2)(0.0f);
  for (int i = item; i < sums; i += RS_FIT_ITEMS) sum += partials[i].yz;
  fit[view * RS_FIT_ITEMS + item] = sum;
}
