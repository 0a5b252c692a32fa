// SPDX-License-Identifier: Apache-2.0
// Turns a rendered image x and a photo y into the planes u = x' + y and v = x' - y that SSIM
// and its gradient read, and sums the pixel term. x' = y + m (x - y) with the mask m (RsLoss):
// where m = 0 both images are equal.
//
// Launch: one work-item per tile of TILE x ROWS pixels, grid tiles_x x tiles_y; any work-group
// size.
//   pair      3 planes u (R, G, B), then 3 planes v, padded as in train/ssim_window.h, borders zero
//   partials  per tile {sum m rho(x - y), sum m (clamp(x) - y)^2, 3 sum m, 0} over R, G, B
// Complexity: one pass over the pixels.
#include "shared/train_layout.h"
#include "train/loss_pixel.h"
#include "train/photo.h"
#include "train/ssim_window.h"

void store_pair(fv x, fv y, fv mask, __global float* u, __global float* v, LossSums* sums) {
  const fv masked = rs_add_pixel(x, y, mask, sums);
  rs_store(masked + 2.0f * y, u);
  rs_store(masked, v);
}

__kernel void prepare_pair(const __global float* image,
                           const __global uint* photo,
                           __global float* pair,
                           __global float4* partials,
                           const RsLoss loss) {
  const int width = loss.width;
  const int height = loss.height;
  const int tile_x = get_global_id(0);
  const int tile_y = get_global_id(1);
  const int tiles_x = (width + TILE - 1) / TILE;
  const int first = tile_x * TILE;
  const int top = tile_y * ROWS;
  if (first >= width || top >= height) return;
  const int last = min(first + TILE, width);
  const int bottom = min(top + ROWS, height);
  const int pixels = width * height;

  LossSums sums = {(fv)(0.0f), (fv)(0.0f), (fv)(0.0f)};
  for (int row = top; row < bottom; ++row) {
    for (int column = first; column < last; column += LANES) {
      const int in = row * width + column;
      const int count = min(last - column, LANES);
      fv x[3];
      fv valid = (fv)(1.0f);
      if (count == LANES) {
        for (int c = 0; c < 3; ++c) x[c] = rs_load(image + c * pixels + in);
      } else {
        // The last columns: lanes beyond the image are x = y = m = 0.
        float tail[4][LANES];
        for (int i = 0; i < LANES; ++i) {
          for (int c = 0; c < 3; ++c) tail[c][i] = i < count ? image[c * pixels + in + i] : 0.0f;
          tail[3][i] = i < count ? 1.0f : 0.0f;
        }
        for (int c = 0; c < 3; ++c) x[c] = rs_load_private(tail[c]);
        valid = rs_load_private(tail[3]);
      }
      fv y[3];
      for (int c = 0; c < 3; ++c) y[c] = rs_photo_channel(photo, loss.planes, pixels, in, count, c);
      const fv alpha = rs_photo_channel(photo, loss.planes, pixels, in, count, 3);
      fv mask = alpha;
      if (loss.composite) {
        const fv rest = valid - alpha;
        y[0] = y[0] * alpha + loss.red * rest;
        y[1] = y[1] * alpha + loss.green * rest;
        y[2] = y[2] * alpha + loss.blue * rest;
        mask = loss.composite == 2 ? rs_photo_weight(photo, loss.planes, pixels, in, count) : valid;
      }
      __global float* out = pair + RS_PADDED(row, loss.stride) + column;
      for (int c = 0; c < 3; ++c) {
        store_pair(x[c], y[c], mask, out + c * loss.plane, out + (3 + c) * loss.plane, &sums);
      }
    }
  }
  partials[tile_y * tiles_x + tile_x] =
      (float4)(rs_lane_sum(sums.pixel), rs_lane_sum(sums.square), rs_lane_sum(sums.weight), 0.0f);
}
