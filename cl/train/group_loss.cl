// SPDX-License-Identifier: Apache-2.0
// The loss and its gradient (what loss_prepare.cl and loss_ssim.cl compute) in the form of GPUs.
//
// Launch of both kernels: a work-group per tile of SIDE x SIDE pixels and channel, grid tiles_x x
// tiles_y x 3 of groups; a work-item per pixel. The window is separable: what it slides over lies
// in local memory with a border of RADIUS, zero beyond the image; a pass along the rows, then one
// along the columns. Neighbouring work-items touch neighbouring addresses, in local memory as well.
//   image     planes R, G, B       photo    as train/photo.h says
//   derivatives  per channel planes E, F, G as large as the image
// Per pixel and channel 2.6 pixels of image and photo are fetched, and as many of each plane of
// derivatives: 26^2 for 16^2.
#define LANES 1
#include "shared/train_layout.h"
#include "train/loss_pixel.h"
#include "train/photo.h"
#include "train/ssim.h"
#include "train/ssim_window.h"

// 0 when SSIM is only reported and has no weight in the loss.
#ifndef SSIM_GRADIENT
#define SSIM_GRADIENT 1
#endif

#define SIDE 16
#define ITEMS (SIDE * SIDE)
// A row of a tile with its border.
#define SPAN (SIDE + 2 * RADIUS)

// The window over p[-5 step] to p[5 step], numbers or vectors.
#define RS_WINDOW(p, step)                                                                     \
  (W0 * (p)[0] + W1 * ((p)[-(step)] + (p)[step]) + W2 * ((p)[-2 * (step)] + (p)[2 * (step)]) + \
   W3 * ((p)[-3 * (step)] + (p)[3 * (step)]) + W4 * ((p)[-4 * (step)] + (p)[4 * (step)]) +     \
   W5 * ((p)[-5 * (step)] + (p)[5 * (step)]))

typedef struct {
  const __global float* image;  // of the channel
  const __global uint* photo;
  int planes;  // of the photo
  int pixels;
  int channel;
  int composite;
  float background;  // of the channel
} Comparison;

Comparison comparison_of(const __global float* image,
                         const __global uint* photo,
                         const RsLoss loss,
                         int channel) {
  const int pixels = loss.width * loss.height;
  const Comparison out = {image + channel * pixels,
                          photo,
                          loss.planes,
                          pixels,
                          channel,
                          loss.composite,
                          channel == 0 ? loss.red : (channel == 1 ? loss.green : loss.blue)};
  return out;
}

typedef struct {
  float x, y, mask;
} Sample;

Sample sample_at(const Comparison* of, int pixel) {
  const float alpha = rs_photo_channel(of->photo, of->planes, of->pixels, pixel, 1, 3);
  const float y = rs_photo_channel(of->photo, of->planes, of->pixels, pixel, 1, of->channel);
  Sample s = {of->image[pixel], y, alpha};
  if (of->composite != 0) {
    s.y = s.y * alpha + of->background * (1.0f - alpha);
    s.mask =
        of->composite == 2 ? rs_photo_weight(of->photo, of->planes, of->pixels, pixel, 1) : 1.0f;
  }
  return s;
}

// Sum over the group, in the first work-item; all must have called it with what they add.
float4 group_sum(float4 value, int lane, __local float4* scratch) {
  scratch[lane] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane < SIDE) {
    for (int i = lane + SIDE; i < ITEMS; i += SIDE) value += scratch[i];
    scratch[lane] = value;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  if (lane == 0) {
    for (int i = 1; i < SIDE; ++i) value += scratch[i];
  }
  return value;
}

// Per tile and channel, tiles of a channel one after the other: pixel_partials {sum m rho(x - y),
// sum m (clamp(x) - y)^2, sum m, 0}, ssim_partials the sum of SSIM.
__kernel __attribute__((reqd_work_group_size(SIDE, SIDE, 1))) void group_ssim_derivatives(
    const __global float* image,
    const __global uint* photo,
    __global float* derivatives,
    __global float4* pixel_partials,
    __global float* ssim_partials,
    const RsLoss loss) {
  __local float2 pair[SPAN * SPAN];  // u, v
  __local float4 rows[SPAN * SIDE];  // along the rows: means of u, v, u^2, v^2
  const int lane = get_local_id(1) * SIDE + get_local_id(0);
  const int channel = get_group_id(2);
  const int width = loss.width;
  const int height = loss.height;
  const int pixels = width * height;
  const Comparison of = comparison_of(image, photo, loss, channel);

  const int left = (int)get_group_id(0) * SIDE - RADIUS;
  const int top = (int)get_group_id(1) * SIDE - RADIUS;
  for (int i = lane; i < SPAN * SPAN; i += ITEMS) {
    const int column = left + i % SPAN;
    const int row = top + i / SPAN;
    float2 uv = (float2)(0.0f);
    if (column >= 0 && column < width && row >= 0 && row < height) {
      const Sample s = sample_at(&of, row * width + column);
      uv.y = s.mask * (s.x - s.y);
      uv.x = uv.y + 2.0f * s.y;
    }
    pair[i] = uv;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = lane; i < SPAN * SIDE; i += ITEMS) {
    const __local float2* p = pair + i / SIDE * SPAN + i % SIDE + RADIUS;
    float4 sum = W0 * (float4)(p[0], p[0] * p[0]);
#define RS_TAP(k, weight)                           \
  {                                                 \
    const float2 a = p[-k];                         \
    const float2 b = p[k];                          \
    sum += weight * (float4)(a + b, a * a + b * b); \
  }
    RS_TAP(1, W1)
    RS_TAP(2, W2)
    RS_TAP(3, W3)
    RS_TAP(4, W4)
    RS_TAP(5, W5)
#undef RS_TAP
    rows[i] = sum;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  const float4 moments = RS_WINDOW(rows + lane + RADIUS * SIDE, SIDE);
  barrier(CLK_LOCAL_MEM_FENCE);  // the sums below lie where the rows were

  const int column = get_global_id(0);
  const int row = get_global_id(1);
  float4 sums = (float4)(0.0f);
  if (column < width && row < height) {
    const int pixel = row * width + column;
    const Ssim ssim = rs_ssim(moments.x, moments.y, moments.z, moments.w);
#if SSIM_GRADIENT
    __global float* out = derivatives + 3 * channel * pixels + pixel;
    out[0] = ssim.e;
    out[pixels] = ssim.f;
    out[2 * pixels] = ssim.g;
#endif
    const Sample s = sample_at(&of, pixel);
    LossSums added = {0.0f, 0.0f, 0.0f};
    rs_add_pixel(s.x, s.y, s.mask, &added);
    sums = (float4)(added.pixel, added.square, added.weight, ssim.value);
  }
  sums = group_sum(sums, lane, rows);
  if (lane == 0) {
    const int tile = ((int)get_group_id(2) * (int)get_num_groups(1) + (int)get_group_id(1)) *
                         (int)get_num_groups(0) +
                     (int)get_group_id(0);
    pixel_partials[tile] = (float4)(sums.xyz, 0.0f);
    ssim_partials[tile] = sums.w;
  }
}

// gradient = pixel_scale * m rho'(x - y) + ssim_scale * m dSSIM/dx' for R, G, B, and
// alpha_scale * m rho'(A - a) for the coverage A of the image and the photo's alpha a.
__kernel __attribute__((reqd_work_group_size(SIDE, SIDE, 1))) void group_gradient(
    const __global float* image,
    const __global uint* photo,
    const __global float* derivatives,
    __global float* gradient,
    const RsLoss loss) {
  const int channel = get_group_id(2);
  const int width = loss.width;
  const int height = loss.height;
  const int pixels = width * height;
  const int column = get_global_id(0);
  const int row = get_global_id(1);
#if SSIM_GRADIENT
  __local float tile[3][SPAN * SPAN];  // E, F, G
  __local float rows[3][SPAN * SIDE];  // their windows along the rows
  const int lane = get_local_id(1) * SIDE + get_local_id(0);
  const int left = (int)get_group_id(0) * SIDE - RADIUS;
  const int top = (int)get_group_id(1) * SIDE - RADIUS;
  const __global float* in = derivatives + 3 * channel * pixels;
  for (int i = lane; i < SPAN * SPAN; i += ITEMS) {
    const int x = left + i % SPAN;
    const int y = top + i / SPAN;
    const bool inside = x >= 0 && x < width && y >= 0 && y < height;
    for (int k = 0; k < 3; ++k) tile[k][i] = inside ? in[k * pixels + y * width + x] : 0.0f;
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int i = lane; i < SPAN * SIDE; i += ITEMS) {
    const int first = i / SIDE * SPAN + i % SIDE + RADIUS;
    for (int k = 0; k < 3; ++k) rows[k][i] = RS_WINDOW(tile[k] + first, 1);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
#endif
  if (column >= width || row >= height) return;
  const Comparison of = comparison_of(image, photo, loss, channel);
  const int pixel = row * width + column;
  const Sample s = sample_at(&of, pixel);
  const float v = s.mask * (s.x - s.y);
  float result = rs_pixel_gradient(v, s.mask, loss.pixel_scale);
#if SSIM_GRADIENT
  const int center = lane + RADIUS * SIDE;
  const float u = v + 2.0f * s.y;
  result += loss.ssim_scale * s.mask *
            (RS_WINDOW(rows[0] + center, SIDE) + u * RS_WINDOW(rows[1] + center, SIDE) +
             v * RS_WINDOW(rows[2] + center, SIDE));
#endif
  gradient[channel * pixels + pixel] = result;
  if (channel > 0) return;
  float by_coverage = 0.0f;
  if (loss.alpha_scale > 0.0f) {
    const float alpha = rs_photo_channel(photo, loss.planes, pixels, pixel, 1, 3);
    const float missing = s.mask * (image[3 * pixels + pixel] - alpha);
    by_coverage = rs_pixel_gradient(missing, s.mask, loss.alpha_scale);
  }
  gradient[3 * pixels + pixel] = by_coverage;
}
