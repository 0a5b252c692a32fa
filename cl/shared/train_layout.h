// SPDX-License-Identifier: Apache-2.0
// Records of training that kernels and host share.
#ifndef RS_SHARED_TRAIN_LAYOUT_H
#define RS_SHARED_TRAIN_LAYOUT_H

#include "shared/compat.h"

// A first moment below this moves nothing; left alone it would decay into denormal numbers, which
// CPUs handle slowly.
#define RS_TINY_MOMENT 1e-30f

// Words of the state that train/step_guard.cl keeps, and the place of two of them: rays of the
// present step that the cap on hits stopped.
#define RS_GUARD_WORDS 9
#define RS_GUARD_CAPPED 7
#define RS_GUARD_POISONED 1u  // bits of its first word
#define RS_GUARD_REPEATED 2u

// Parts of the sums that train/step_guard.cl keeps of a photo.
#define RS_FIT_ITEMS 64

// What becomes of a Gaussian in the new set of density control; the host's DensityRole tells more.
#define RS_ROLE_KEEP 0u
#define RS_ROLE_CLONE 1u
#define RS_ROLE_FIRST_CHILD 2u
#define RS_ROLE_SECOND_CHILD 3u
#define RS_ROLE_FIRST_HALF 4u
#define RS_ROLE_SECOND_HALF 5u
#define RS_ROLE_PART 6u

// In place of the row that a row of a new set comes from: it is new.
#define RS_NO_SOURCE 0xffffffffu

// Groups of parameters of a model: means, quaternions, scales, opacities, SH coefficients.
#define RS_PARAMETER_GROUPS 5
#define RS_SH_GROUP 4

// A launch over all groups of parameters: the first of its work-groups that belongs to each, and
// behind them their number.
typedef struct {
  rs_uint first[RS_PARAMETER_GROUPS + 1];
} RsParts;
RS_STATIC_ASSERT_SIZE(RsParts, 24);

// One step of Adam.
typedef struct {
  rs_float beta1, rest1;  // rest = 1 - beta
  rs_float beta2, rest2;
  rs_float epsilon;
  rs_float root_scale;  // 1 / sqrt(1 - beta2^step)
  // Over 1 - beta1^step, of each group; of SH the first coefficient's, and behind it the others'.
  rs_float rates[RS_PARAMETER_GROUPS + 1];
  rs_uint begin, end;  // Gaussians of the launch
  rs_uint rows;        // that the buffers of moments have room for
  rs_uint padding;
} RsAdam;
RS_STATIC_ASSERT_SIZE(RsAdam, 64);

// An image x, the photo y that the loss compares it with, and what the loss makes of both.
typedef struct {
  rs_int width, height;
  rs_int stride, plane;  // of the padded planes that loss_prepare.cl and loss_ssim.cl share
  rs_int planes;         // of the photo, as train/photo.h says
  // The mask m. 0: the photo's alpha; 1: the photo is blended over the background and m is 1; 2:
  // the same, and m is the photo's plane of weights.
  rs_int composite;
  rs_float red, green, blue;  // of the background
  // Of the terms in the gradient; that of coverage is 0 where alpha is a mask.
  rs_float pixel_scale, ssim_scale, alpha_scale;
} RsLoss;
RS_STATIC_ASSERT_SIZE(RsLoss, 48);

#endif
