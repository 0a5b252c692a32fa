// SPDX-License-Identifier: Apache-2.0
// A photo on the device: `planes` words a pixel, in planes of `pixels` words each, row by row, so
// that the numbers of a file keep their precision and vectors are read whole.
//   1  r | g << 8 | b << 16 | a << 24, of 255
//   2  r | g << 16, then b | a << 16, of 65535
//   4  r, g, b, a as floats in [0, 1]
// Alpha is straight. Where some pixels count less than others a plane of weights follows: floats in
// [0, 1] behind floats, else words of 255. Made by io::load_photo() and train/photo_cache.cl.
#ifndef RS_TRAIN_PHOTO_H
#define RS_TRAIN_PHOTO_H

#include "parallel/vector_lanes.h"

// The first `count` of LANES words, zeros behind them.
__attribute__((always_inline)) uv rs_photo_words(const __global uint* words, int count) {
  if (count >= LANES) return rs_load_words(words);
  uint tail[LANES];
  for (int i = 0; i < LANES; ++i) tail[i] = i < count ? words[i] : 0;
  return rs_load_private_words(tail);
}

// A channel (0 to 3: r, g, b, a) of `count` pixels from pixel `at` on; 0 in the lanes behind them.
__attribute__((always_inline)) fv rs_photo_channel(
    const __global uint* photo, int planes, int pixels, int at, int count, int channel) {
  if (planes == 1) {
    const uv words = rs_photo_words(photo + at, count);
    return rs_to_float((words >> (8 * channel)) & 255u) * (1.0f / 255.0f);
  }
  if (planes == 2) {
    const uv words = rs_photo_words(photo + channel / 2 * pixels + at, count);
    return rs_to_float((words >> (16 * (channel % 2))) & 65535u) * (1.0f / 65535.0f);
  }
  return rs_as_float(rs_photo_words(photo + channel * pixels + at, count));
}

// How much they count, from the plane of weights.
__attribute__((always_inline)) fv rs_photo_weight(
    const __global uint* photo, int planes, int pixels, int at, int count) {
  const uv words = rs_photo_words(photo + planes * pixels + at, count);
  return planes == 4 ? rs_as_float(words) : rs_to_float(words) * (1.0f / 255.0f);
}

#endif
