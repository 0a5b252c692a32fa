// SPDX-License-Identifier: Apache-2.0
// Decides on the device which training steps count. guard_loss, before the update, marks a step
// whose loss is not finite, and one whose view had no room (trace/view_sizes.cl), which the host
// will repeat; the kernels that change the model read the mark and leave everything as it is.
// guard_close, after the update, keeps count of what is not repeated: a step is bad when it was
// marked, or when more than one Gaussian in RS_GUARD_SHARE refused its gradient. After `limit` bad
// steps in a row all further steps are marked, until the host looks.
//   state: 0 mark of the present step, 1 bad steps in a row, 2 bad steps, 3 stopped (0 or 1), 4
//   refused gradients before this step, 5 and 6 rays of all steps that the cap on hits stopped (the
//   lower word first)
// Launch: guard_loss any number of work-items, which walk the partial sums of the loss; guard_close
// one work-item.
#include "parallel/counter.h"
#include "shared/train_layout.h"

#define RS_GUARD_SHARE 1000

__kernel void guard_loss(const __global float4* pixel_partials,
                         const __global float* ssim_partials,
                         int pixel_sums,
                         int ssim_sums,
                         const __global uint* overflow,
                         volatile __global uint* state) {
  const int items = get_global_size(0);
  // By the bits of the exponent: compilers may take zero times anything for zero.
  uint poisoned = 0;
  for (int i = get_global_id(0); i < pixel_sums; i += items)
    poisoned |= (as_uint(pixel_partials[i].x) & 0x7f800000u) == 0x7f800000u;
  for (int i = get_global_id(0); i < ssim_sums; i += items)
    poisoned |= (as_uint(ssim_partials[i]) & 0x7f800000u) == 0x7f800000u;
  if (overflow[0] != 0) {
    atomic_or(state, RS_GUARD_REPEATED);
  } else if (poisoned != 0) {
    atomic_or(state, RS_GUARD_POISONED);
  }
}

__kernel void guard_close(const __global uint* refused,
                          const __global uint* capped,
                          uint count,
                          uint limit,
                          volatile __global uint* state) {
  if ((state[0] & RS_GUARD_REPEATED) != 0) {
    state[0] = state[3];
    return;
  }
  rs_count(state + 5, capped[0]);
  state[6] += capped[1];
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
