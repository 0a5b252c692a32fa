// SPDX-License-Identifier: Apache-2.0
// Adam (Kingma and Ba 2015) for all parameters of the Gaussians in one launch, and the moves of its
// moments.
//
// A Gaussian with a gradient that is not finite keeps its parameters and moments and is counted;
// with visible_only so does, uncounted, one that no ray met (screen[3 i + 2] == 0). A work-item
// owns BLOCK consecutive Gaussians, so every group is one contiguous run for it; only a block with
// an exception is walked Gaussian by Gaussian.
//
// A guard word that is not 0 turns the whole step off (train/guard.cl).
//
// Launch of adam_step: one work-item per block, any work-group size.
// Complexity: reads parameter, gradient and both moments once, writes all but the gradient: bound
// by memory.
#include "train/lanes.h"

#ifndef BLOCK
#define BLOCK 64
#endif
// Most SH floats of one Gaussian: 25 coefficients of R, G, B.
#define MAX_SH 75
// A first moment below this moves nothing; left alone it would decay into denormal numbers, which
// CPUs handle slowly.
#define TINY_MOMENT 1e-30f

typedef struct {
  float beta1, rest1;  // rest = 1 - beta
  float beta2, rest2;
  float epsilon;
  float root_scale;  // 1 / sqrt(1 - beta2^step)
} AdamConstants;

typedef struct {
  __global float* parameter;
  const __global float* gradient;
  __global float* first;
  __global float* second;
} AdamGroup;

// `rate` is the learning rate over 1 - beta1^step.
void adam_lanes(AdamGroup group, size_t i, lanes rate, const AdamConstants* k) {
  const lanes g = rs_load(group.gradient + i);
  lanes first = k->beta1 * rs_load(group.first + i) + k->rest1 * g;
  first = rs_pick(fabs(first) < TINY_MOMENT, 0.0f, first);
  const lanes second = k->beta2 * rs_load(group.second + i) + k->rest2 * g * g;
  rs_store(first, group.first + i);
  rs_store(second, group.second + i);
  rs_store(
      rs_load(group.parameter + i) - rate * first / (sqrt(second) * k->root_scale + k->epsilon),
      group.parameter + i);
}

void adam_scalar(AdamGroup group, size_t i, float rate, const AdamConstants* k) {
  const float g = group.gradient[i];
  float first = k->beta1 * group.first[i] + k->rest1 * g;
  first = fabs(first) < TINY_MOMENT ? 0.0f : first;
  const float second = k->beta2 * group.second[i] + k->rest2 * g * g;
  group.first[i] = first;
  group.second[i] = second;
  group.parameter[i] -= rate * first / (sqrt(second) * k->root_scale + k->epsilon);
}

void adam_run(AdamGroup group, size_t begin, size_t end, float rate, const AdamConstants* k) {
  size_t i = begin;
  for (; i + VECTOR <= end; i += VECTOR) adam_lanes(group, i, (lanes)(rate), k);
  for (; i < end; ++i) adam_scalar(group, i, rate, k);
}

// SH: `rates` repeats with `period` floats and reaches VECTOR beyond it; `begin` is the start of a
// Gaussian.
void adam_run_sh(AdamGroup group,
                 size_t begin,
                 size_t end,
                 const float* rates,
                 int period,
                 const AdamConstants* k) {
  const int advance = VECTOR % period;
  int phase = 0;
  size_t i = begin;
  for (; i + VECTOR <= end; i += VECTOR) {
    adam_lanes(group, i, rs_load_private(rates + phase), k);
    phase += advance;
    phase = phase >= period ? phase - period : phase;
  }
  for (; i < end; ++i) adam_scalar(group, i, rates[phase++], k);
}

// Exponent of infinity and NaN. Compilers may take zero times anything for zero, so numbers that
// are not finite are known by their bits.
#define RS_EXPONENT 0x7f800000u

// Whether a gradient of the run is not finite.
bool poisoned(const __global float* gradient, size_t begin, size_t end) {
  const __global uint* words = (const __global uint*)gradient;
  lane_words most = (lane_words)(0u);
  uint rest = 0;
  size_t i = begin;
  for (; i + VECTOR <= end; i += VECTOR) most = max(most, rs_load_words(words + i) & RS_EXPONENT);
  for (; i < end; ++i) rest = max(rest, words[i] & RS_EXPONENT);
  return rest == RS_EXPONENT || rs_any_lane(most == RS_EXPONENT);
}

__kernel void adam_step(__global float* means,
                        const __global float* means_gradient,
                        __global float* means_first,
                        __global float* means_second,
                        __global float* quaternions,
                        const __global float* quaternions_gradient,
                        __global float* quaternions_first,
                        __global float* quaternions_second,
                        __global float* scales,
                        const __global float* scales_gradient,
                        __global float* scales_first,
                        __global float* scales_second,
                        __global float* opacities,
                        const __global float* opacities_gradient,
                        __global float* opacities_first,
                        __global float* opacities_second,
                        __global float* sh,
                        const __global float* sh_gradient,
                        __global float* sh_first,
                        __global float* sh_second,
                        const __global float* screen,
                        __global uint* skipped,
                        const __global uint* guard,
                        uint count,
                        int sh_floats,
                        float means_rate,
                        float quaternions_rate,
                        float scales_rate,
                        float opacities_rate,
                        float sh_dc_rate,
                        float sh_rest_rate,
                        float beta1,
                        float rest1,
                        float beta2,
                        float rest2,
                        float epsilon,
                        float root_scale,
                        int visible_only) {
  const size_t first = get_global_id(0) * (size_t)BLOCK;
  if (first >= count || guard[0] != 0) return;
  const size_t last = min(first + BLOCK, (size_t)count);
  const AdamConstants k = {beta1, rest1, beta2, rest2, epsilon, root_scale};
  const AdamGroup mean_group = {means, means_gradient, means_first, means_second};
  const AdamGroup quaternion_group = {quaternions, quaternions_gradient, quaternions_first,
                                      quaternions_second};
  const AdamGroup scale_group = {scales, scales_gradient, scales_first, scales_second};
  const AdamGroup opacity_group = {opacities, opacities_gradient, opacities_first,
                                   opacities_second};
  const AdamGroup sh_group = {sh, sh_gradient, sh_first, sh_second};
  float sh_rates[MAX_SH + VECTOR];
  for (int i = 0, phase = 0; i < sh_floats + VECTOR; ++i) {
    sh_rates[i] = phase < 3 ? sh_dc_rate : sh_rest_rate;
    phase = phase + 1 == sh_floats ? 0 : phase + 1;
  }

#define RS_POISONED(from, to)                              \
  (poisoned(means_gradient, 3 * (from), 3 * (to)) ||       \
   poisoned(quaternions_gradient, 4 * (from), 4 * (to)) || \
   poisoned(scales_gradient, 3 * (from), 3 * (to)) ||      \
   poisoned(opacities_gradient, (from), (to)) ||           \
   poisoned(sh_gradient, sh_floats * (from), sh_floats * (to)))
#define RS_UPDATE(from, to)                                               \
  adam_run(mean_group, 3 * (from), 3 * (to), means_rate, &k);             \
  adam_run(quaternion_group, 4 * (from), 4 * (to), quaternions_rate, &k); \
  adam_run(scale_group, 3 * (from), 3 * (to), scales_rate, &k);           \
  adam_run(opacity_group, (from), (to), opacities_rate, &k);              \
  adam_run_sh(sh_group, sh_floats*(from), sh_floats*(to), sh_rates, sh_floats, &k)

  uint visible = 0;
  for (size_t i = first; i < last; ++i) visible += !visible_only || screen[3 * i + 2] != 0.0f;
  if (visible == 0) return;
  if (visible == last - first && !RS_POISONED(first, last)) {
    RS_UPDATE(first, last);
    return;
  }
  uint bad = 0;
  for (size_t i = first; i < last; ++i) {
    if (visible_only && screen[3 * i + 2] == 0.0f) continue;
    if (!RS_POISONED(i, i + 1)) {
      RS_UPDATE(i, i + 1);
    } else {
      ++bad;
    }
  }
  if (bad > 0) atomic_add(skipped, bad);
}

// Row i of `to` becomes row source[i] of `from`, or zeros where source[i] is 0xffffffff. Launch:
// one work-item per new Gaussian; `width` floats per row.
__kernel void remap_rows(const __global float* from,
                         __global float* to,
                         const __global uint* source,
                         int width,
                         uint count) {
  const size_t i = get_global_id(0);
  if (i >= count) return;
  const uint old = source[i];
  for (int k = 0; k < width; ++k) {
    to[i * width + k] = old == 0xffffffffu ? 0.0f : from[(size_t)old * width + k];
  }
}
