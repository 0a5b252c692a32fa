// SPDX-License-Identifier: Apache-2.0
// Decides on the device which training steps count. guard_loss, between the loss of a view and its
// gradient, marks a step whose loss is not finite, and one whose view had no room
// (trace/view_sizes.cl), which the host will repeat; the kernels that change the model read the
// mark and leave everything as it is. It also counts the rays that the cap on hits stopped, in this
// view and those before it in the step, and notes how near the picture was to its photo.
// guard_close, after the update, keeps count of what is not repeated: a step is bad when it was
// marked, or when more than one Gaussian in RS_GUARD_SHARE refused its gradient. After `limit` bad
// steps in a row all further steps are marked, until the host looks.
//   state: 0 mark of the present step, 1 bad steps in a row, 2 bad steps, 3 stopped (0 or 1), 4
//   refused gradients before this step, 5 and 6 rays of all steps that the cap on hits stopped, 7
//   and 8 (RS_GUARD_CAPPED) those of the present step (the lower word first)
//   pixel_partials: sums of the loss, {pixel term, squared error, weight, 0}
//   capped: the view's capped rays from word `capped_place` on, in two words where `wide`
//   fit: per photo RS_FIT_ITEMS pairs of squared error and weight; `view` numbers the photo, -1
//   where nothing is noted
// Launch: guard_loss RS_FIT_ITEMS work-items, which walk the partial sums; guard_close one
// work-item.
#include "parallel/counter.h"
#include "shared/train_layout.h"

#define RS_GUARD_SHARE 1000

__kernel void guard_loss(const __global float4* pixel_partials,
                         const __global float* ssim_partials,
                         int pixel_sums,
                         int ssim_sums,
                         const __global uint* overflow,
                         const __global uint* capped,
                         uint capped_place,
                         int wide,
                         int first_view,
                         int view,
                         __global float2* fit,
                         volatile __global uint* state) {
  const int item = get_global_id(0);
  // By the bits of the exponent: compilers may take zero times anything for zero.
  uint poisoned = 0;
  float2 sum = (float2)(0.0f);
  for (int i = item; i < pixel_sums; i += RS_FIT_ITEMS) {
    const float4 part = pixel_partials[i];
    poisoned |= (as_uint(part.x) & 0x7f800000u) == 0x7f800000u;
    sum += part.yz;
  }
  for (int i = item; i < ssim_sums; i += RS_FIT_ITEMS)
    poisoned |= (as_uint(ssim_partials[i]) & 0x7f800000u) == 0x7f800000u;
  if (overflow[0] != 0) {
    atomic_or(state, RS_GUARD_REPEATED);
  } else if (poisoned != 0) {
    atomic_or(state, RS_GUARD_POISONED);
  }
  if (view >= 0 && overflow[0] == 0) fit[view * RS_FIT_ITEMS + item] = sum;
  if (item > 0) return;
  volatile __global uint* of_step = state + RS_GUARD_CAPPED;
  if (first_view) {
    of_step[0] = 0;
    of_step[1] = 0;
  }
  rs_count(of_step, capped[capped_place]);
  if (wide) of_step[1] += capped[capped_place + 1];
}

__kernel void guard_close(const __global uint* refused,
                          uint count,
                          uint limit,
                          volatile __global uint* state) {
  if ((state[0] & RS_GUARD_REPEATED) != 0) {
    state[0] = state[3];
    return;
  }
  rs_count(state + 5, state[RS_GUARD_CAPPED]);
  state[6] += state[RS_GUARD_CAPPED + 1];
  const uint now = refused[0];
  const uint fresh = now - state[4];
  state[4] = now;
  if (state[3] == 0) {
    const bool bad = state[0] != 0 || fresh > count / RS_GUARD_SHARE;
    state[1] = bad ? state[1] + 1 : 0;
    state[2] += bad;
    state[3] = state[1] >= limit;
  }
  state[0] = state[3];
}
