// SPDX-License-Identifier: Apache-2.0
// SSIM of the pair u = x + y, v = x - y and its gradient with respect to x (train/ssim.h).
//
// Launch of both kernels: one work-item per tile of TILE x ROWS pixels and channel, grid tiles_x x
// tiles_y x 3.
//   pair         3 planes u, 3 planes v
//   derivatives  per channel planes E, F, G
// Both are padded, with borders of zeros.
// Complexity: 2 x 11 multiply-adds per moment and pixel: a column pass into private memory, then a
// row pass.
#include "shared/train_layout.h"
#include "train/loss_pixel.h"
#include "train/photo.h"
#include "train/ssim.h"
#include "train/ssim_window.h"

// 0 when SSIM is only reported and has no weight in the loss.
#ifndef SSIM_GRADIENT
#define SSIM_GRADIENT 1
#endif

// partials[channel * tiles + tile] = sum of SSIM over the tile.
__kernel void ssim_derivatives(const __global float* pair,
                               __global float* derivatives,
                               __global float* partials,
                               const RsLoss loss) {
  const int width = loss.width;
  const int height = loss.height;
  const int stride = loss.stride;
  const int plane = loss.plane;
  const int tile_x = get_global_id(0);
  const int tile_y = get_global_id(1);
  const int channel = get_global_id(2);
  const int tiles_x = (width + TILE - 1) / TILE;
  const int tiles_y = (height + ROWS - 1) / ROWS;
  const int first = tile_x * TILE;
  const int top = tile_y * ROWS;
  if (first >= width || top >= height || channel >= 3) return;
  const int last = min(first + TILE, width);
  const int bottom = min(top + ROWS, height);
  const int span = (last - first + LANES - 1) / LANES * LANES + 2 * HALO;

  float mean_u[TILE_SPAN], mean_v[TILE_SPAN], square_u[TILE_SPAN], square_v[TILE_SPAN];
  fv sum = (fv)(0.0f);
  for (int row = top; row < bottom; ++row) {
    const __global float* u = pair + channel * plane + RS_PADDED(row, stride) + first - HALO;
    const __global float* v = u + 3 * plane;
    for (int i = 0; i < span; i += LANES) {
      const __global float* pu = u + i;
      const __global float* pv = v + i;
      fv a = rs_load(pu);
      fv b = rs_load(pv);
      fv mu = W0 * a, mv = W0 * b;
      fv qu = mu * a, qv = mv * b;
#define RS_TAP(k, weight)                  \
  {                                        \
    a = rs_load(pu - k * stride);          \
    b = rs_load(pv - k * stride);          \
    const fv c = rs_load(pu + k * stride); \
    const fv d = rs_load(pv + k * stride); \
    mu += weight * (a + c);                \
    mv += weight * (b + d);                \
    qu += weight * (a * a + c * c);        \
    qv += weight * (b * b + d * d);        \
  }
      RS_TAP(1, W1)
      RS_TAP(2, W2)
      RS_TAP(3, W3)
      RS_TAP(4, W4)
      RS_TAP(5, W5)
#undef RS_TAP
      rs_store_private(mu, mean_u + i);
      rs_store_private(mv, mean_v + i);
      rs_store_private(qu, square_u + i);
      rs_store_private(qv, square_v + i);
    }
    __global float* out = derivatives + 3 * channel * plane + RS_PADDED(row, stride) + first;
    for (int i = 0; first + i < last; i += LANES) {
      const Ssim ssim =
          rs_ssim(rs_window_row(mean_u + HALO + i), rs_window_row(mean_v + HALO + i),
                  rs_window_row(square_u + HALO + i), rs_window_row(square_v + HALO + i));
      const iv inside = first + i + RS_LANE_INDEX < last;
      sum += rs_pick(inside, ssim.value, 0.0f);
#if SSIM_GRADIENT
      rs_store(rs_pick(inside, ssim.e, 0.0f), out + i);
      rs_store(rs_pick(inside, ssim.f, 0.0f), out + plane + i);
      rs_store(rs_pick(inside, ssim.g, 0.0f), out + 2 * plane + i);
#endif
    }
  }
  partials[(channel * tiles_y + tile_y) * tiles_x + tile_x] = rs_lane_sum(sum);
}

// LANES neighbouring pixels of a plane, of which the row has `count`; those beyond are 0.
fv load_pixels(const __global float* in, bool whole, int count) {
  if (whole) return rs_load(in);
  float tail[LANES];
  for (int k = 0; k < LANES; ++k) tail[k] = k < count ? in[k] : 0.0f;
  return rs_load_private(tail);
}

void store_pixels(fv values, bool whole, int count, __global float* out) {
  if (whole) {
    rs_store(values, out);
    return;
  }
  float tail[LANES];
  rs_store_private(values, tail);
  for (int k = 0; k < LANES && k < count; ++k) out[k] = tail[k];
}

// gradient = pixel_scale * m rho'(x - y) + ssim_scale * m dSSIM/dx' for R, G, B, and
// alpha_scale * m rho'(A - a) for the coverage A of the image and the photo's alpha a.
__kernel void loss_gradient(const __global float* image,
                            const __global float* pair,
                            const __global float* derivatives,
                            const __global uint* photo,
                            __global float* gradient,
                            const RsLoss loss) {
  const int width = loss.width;
  const int height = loss.height;
  const int stride = loss.stride;
  const int plane = loss.plane;
  const int tile_x = get_global_id(0);
  const int tile_y = get_global_id(1);
  const int channel = get_global_id(2);
  const int first = tile_x * TILE;
  const int top = tile_y * ROWS;
  if (first >= width || top >= height || channel >= 3) return;
  const int last = min(first + TILE, width);
  const int bottom = min(top + ROWS, height);
  const int span = (last - first + LANES - 1) / LANES * LANES + 2 * HALO;
  const int pixels = width * height;

  float e[TILE_SPAN], f[TILE_SPAN], g[TILE_SPAN];
  for (int row = top; row < bottom; ++row) {
#if SSIM_GRADIENT
    const __global float* in =
        derivatives + 3 * channel * plane + RS_PADDED(row, stride) + first - HALO;
    for (int i = 0; i < span; i += LANES) {
      rs_store_private(rs_window_column(in + i, stride), e + i);
      rs_store_private(rs_window_column(in + plane + i, stride), f + i);
      rs_store_private(rs_window_column(in + 2 * plane + i, stride), g + i);
    }
#endif
    for (int i = 0; first + i < last; i += LANES) {
      const __global float* center = pair + channel * plane + RS_PADDED(row, stride) + first + i;
      const fv v = rs_load(center + 3 * plane);
      const int column = first + i;
      const int pixel = row * width + column;
      const bool whole = column + LANES <= last;
      fv mask = (fv)(1.0f);
      if (loss.composite == 0)
        mask = rs_photo_channel(photo, loss.planes, pixels, pixel, last - column, 3);
      if (loss.composite == 2)
        mask = rs_photo_weight(photo, loss.planes, pixels, pixel, last - column);
      fv result = rs_pixel_gradient(v, mask, loss.pixel_scale);
#if SSIM_GRADIENT
      const fv u = rs_load(center);
      result += loss.ssim_scale * mask *
                (rs_window_row(e + HALO + i) + u * rs_window_row(f + HALO + i) +
                 v * rs_window_row(g + HALO + i));
#endif
      __global float* out = gradient + channel * pixels + pixel;
      store_pixels(result, whole, last - column, out);
      if (channel > 0) continue;
      fv by_coverage = (fv)(0.0f);
      if (loss.alpha_scale > 0.0f) {
        const __global float* coverage = image + 3 * pixels + pixel;
        const fv alpha = rs_photo_channel(photo, loss.planes, pixels, pixel, last - column, 3);
        const fv missing = mask * (load_pixels(coverage, whole, last - column) - alpha);
        by_coverage = rs_pixel_gradient(missing, mask, loss.alpha_scale);
      }
      store_pixels(by_coverage, whole, last - column, gradient + 3 * pixels + pixel);
    }
  }
}
