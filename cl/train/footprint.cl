// SPDX-License-Identifier: Apache-2.0
// The least size that a Gaussian may have: a share of the smallest pixel of any training view that
// sees its mean. Thinner ones are met by some rays of some views and by none of the next: they
// learn where the pixels' centres are, not the scene (the sampling limit of Yu et al. 2024,
// "Mip-Splatting"; as a limit of the parameters: Blanc et al. 2025, "RayGaussX").
//
// Launch: one work-item per Gaussian, any group size.
// Complexity of footprint_floor: O(N views) arithmetic, one read and one write per Gaussian.
#include "shared/activation.h"
#include "shared/layout.h"

// lows[i] becomes the least scale parameter of Gaussian i: that of `share` pixels. A Gaussian that
// no view sees has none.
__kernel void footprint_floor(uint count,
                              uint views,
                              float share,
                              __global const RsFootprintView* cameras,
                              __global const float* means,
                              __global float* lows) {
  const size_t i = get_global_id(0);
  if (i >= count) return;
  const float3 mean = vload3(i, means);
  float least = INFINITY;
  for (uint v = 0; v < views; ++v) {
    __global const RsFootprintView* c = cameras + v;
    const float3 d = mean - (float3)(c->center[0], c->center[1], c->center[2]);
    const float x = c->rotation[0] * d.x + c->rotation[1] * d.y + c->rotation[2] * d.z;
    const float y = c->rotation[3] * d.x + c->rotation[4] * d.y + c->rotation[5] * d.z;
    const float z = c->rotation[6] * d.x + c->rotation[7] * d.y + c->rotation[8] * d.z;
    float pixel = c->spacing;
    if (c->kind == RS_FOOTPRINT_DISTANCE) pixel *= length(d);
    if (c->kind == RS_FOOTPRINT_DEPTH) {
      const bool seen = z > 0.0f && x >= c->low[0] * z && x <= c->high[0] * z &&
                        y >= c->low[1] * z && y <= c->high[1] * z;
      pixel = seen ? pixel * z : INFINITY;
    }
    least = fmin(least, pixel);
  }
  const float size = share * least;
  float low = -INFINITY;
  if (size > 0.0f && size < RS_LARGEST_SCALE) low = rs_parameter_of_scale(size);
  lows[i] = low;
}

// Keeps all scale parameters within two limits. A guard word that is not 0 turns it off.
__kernel void limit_scales(
    uint count, float low, float high, __global const uint* guard, __global float* scales) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float3 scale = vload3(i, scales);
  // Comparisons with a NaN are false: it stays what it is.
  const float3 raised = select(scale, (float3)(low), scale < (float3)(low));
  vstore3(select(raised, (float3)(high), raised > (float3)(high)), i, scales);
}

// Makes discs: the shortest scale parameter, a logarithm, becomes at most the next one + `thinner`.
// Of equal ones it is the last. A guard word that is not 0 turns it off.
__kernel void flatten_scales(uint count,
                             float thinner,
                             __global const uint* guard,
                             __global float* scales) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  float3 s = vload3(i, scales);
  if (s.x < s.y && s.x < s.z) {
    s.x = fmin(s.x, fmin(s.y, s.z) + thinner);
  } else if (s.y < s.z) {
    s.y = fmin(s.y, fmin(s.x, s.z) + thinner);
  } else {
    s.z = fmin(s.z, fmin(s.x, s.y) + thinner);
  }
  vstore3(s, i, scales);
}

// Raises scale parameters to their least value. A guard word that is not 0 turns it off.
__kernel void raise_scales(uint count,
                           __global const float* lows,
                           __global const uint* guard,
                           __global float* scales) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  const float low = lows[i];
  const float3 scale = vload3(i, scales);
  // Written so that a NaN stays what it is.
  if (scale.x < low || scale.y < low || scale.z < low) {
    vstore3((float3)(scale.x < low ? low : scale.x, scale.y < low ? low : scale.y,
                     scale.z < low ? low : scale.z),
            i, scales);
  }
}
