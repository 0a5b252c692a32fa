// SPDX-License-Identifier: Apache-2.0
// A photo at a smaller size: the average over the area of each target pixel, colours weighted by
// alpha and by how much their pixels count. Nothing is rounded: the result is floats.
//
// reduce_photo: one work-item per target pixel. photo, out: as train/photo.h says, out with 4
// planes; `weighted`: both have a plane of weights. Pixels without any coverage are 0.
// Complexity: source pixels.
//
// mask_photo: the same photo without what `mask` (PixelMask of mask_width x mask_height, any size)
// marks, which counts for nothing: its alpha is 0, or with `weights` its weight, in a plane that
// follows. One work-item per pixel.
#define LANES 1
#include "train/photo.h"

// The share of pixel `source` of `sources` along an axis in pixel `target` of `targets`, in whole
// parts of 1 / targets of a source pixel: exact, and within 32 bits for 32768 pixels a side.
int overlap(int source, int sources, int target, int targets) {
  return min((source + 1) * targets, (target + 1) * sources) -
         max(source * targets, target * sources);
}

// r, g, b, a in [0, 1].
float4 pixel_of(const __global uint* photo, int planes, int pixels, int at) {
  if (planes == 1) return convert_float4(as_uchar4(photo[at])) * (1.0f / 255.0f);
  float channel[4];
  for (int c = 0; c < 4; ++c) channel[c] = rs_photo_channel(photo, planes, pixels, at, 1, c);
  return (float4)(channel[0], channel[1], channel[2], channel[3]);
}

__kernel void reduce_photo(const __global uint* photo,
                           __global uint* out,
                           int planes,
                           int weighted,
                           int width,
                           int height,
                           int out_width,
                           int out_height) {
  const int target = get_global_id(0);
  const int out_pixels = out_width * out_height;
  if (target >= out_pixels) return;
  const int x = target % out_width;
  const int y = target / out_width;
  const int left = x * width / out_width;
  const int right = ((x + 1) * width + out_width - 1) / out_width;
  const int top = y * height / out_height;
  const int bottom = ((y + 1) * height + out_height - 1) / out_height;
  const int pixels = width * height;

  // Colours by coverage and coverage; what counts.
  float4 sum = (float4)(0.0f);
  float counted = 0.0f;
  for (int row = top; row < bottom; ++row) {
    // Sums of a row first: fewer terms, less rounding.
    float4 row_sum = (float4)(0.0f);
    float row_counted = 0.0f;
    for (int column = left; column < right; ++column) {
      const int at = row * width + column;
      const float4 pixel = pixel_of(photo, planes, pixels, at);
      float share = overlap(column, width, x, out_width);
      if (weighted) share *= rs_photo_weight(photo, planes, pixels, at, 1);
      row_counted += share;
      row_sum += share * pixel.w * (float4)(pixel.xyz, 1.0f);
    }
    const float share = overlap(row, height, y, out_height);
    sum += share * row_sum;
    counted += share * row_counted;
  }
  const float4 color = sum.w > 0.0f ? sum / sum.w : (float4)(0.0f);
  out[target] = as_uint(color.x);
  out[out_pixels + target] = as_uint(color.y);
  out[2 * out_pixels + target] = as_uint(color.z);
  out[3 * out_pixels + target] = as_uint(counted > 0.0f ? min(sum.w / counted, 1.0f) : 0.0f);
  if (weighted) out[4 * out_pixels + target] = as_uint(counted / ((float)width * (float)height));
}

__kernel void mask_photo(const __global uint* photo,
                         const __global uint* mask,
                         __global uint* out,
                         int planes,
                         int weighted,
                         int weights,
                         int width,
                         int height,
                         int mask_width,
                         int mask_height) {
  const int at = get_global_id(0);
  const int pixels = width * height;
  if (at >= pixels) return;
  const int x = at % width * mask_width / width;
  const int y = at / width * mask_height / height;
  const int bit = y * mask_width + x;
  const bool counts = (mask[bit / 32] >> (bit % 32) & 1u) == 0;
  for (int plane = 0; plane < planes; ++plane) {
    uint word = photo[plane * pixels + at];
    // The plane of alpha, which is the upper bits of the last one where it is not alone.
    if (!weights && !counts && plane == planes - 1)
      word = planes == 4 ? 0 : word & (planes == 1 ? 0xffffffu : 0xffffu);
    out[plane * pixels + at] = word;
  }
  if (!weights) return;
  const uint whole = planes == 4 ? as_uint(1.0f) : 255u;
  const uint weight = weighted ? photo[planes * pixels + at] : whole;
  out[planes * pixels + at] = counts ? weight : 0;
}
