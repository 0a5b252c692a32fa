// SPDX-License-Identifier: Apache-2.0
// Folds the per-tile sums of the loss to one record per work-item, in a fixed order (no atomics, so
// that equal inputs give equal bits).
//
// Launch: any number of work-items; work-item i writes sums[i] = {pixel, squared error, weight,
// SSIM} of the tiles i, i + items, ...
__kernel void fold_loss(const __global float4* pixel_partials,
                        const __global float* ssim_partials,
                        __global float4* sums,
                        int pixel_sums,
                        int ssim_sums) {
  const int items = get_global_size(0);
  float4 sum = (float4)(0.0f);
  for (int i = get_global_id(0); i < pixel_sums; i += items) sum += pixel_partials[i];
  sum.w = 0.0f;
  for (int i = get_global_id(0); i < ssim_sums; i += items) sum.w += ssim_partials[i];
  sums[get_global_id(0)] = sum;
}
