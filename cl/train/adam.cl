// SPDX-License-Identifier: Apache-2.0
// Adam (Kingma and Ba 2015) for the parameters of the Gaussians: first which of them take the step,
// then one group of parameters after the other; and the moves of its moments.
//
// A Gaussian with a gradient that is not finite keeps its parameters and moments and is counted;
// with visible_only so does, uncounted, one that no ray met (screen[3 i + 2] == 0). A guard word
// that is not 0 turns the whole step off (train/step_guard.cl).
#include "parallel/vector_lanes.h"
#include "shared/train_layout.h"

// Gaussians of a work-group of choose_steps.
#ifndef BLOCK
#define BLOCK 64
#endif
// Work-items of a group.
#ifndef GROUP
#define GROUP 1
#endif
// Floats of one Gaussian in the group of parameters, and those that a work-item of adam_step
// updates: many on CPUs; one vector on GPUs, so that neighbours touch neighbouring addresses.
#ifndef WIDTH
#define WIDTH 1
#endif
#ifndef SPAN
#define SPAN LANES
#endif

// Exponent of infinity and NaN. Compilers may take zero times anything for zero, so numbers that
// are not finite are known by their bits.
#define RS_EXPONENT 0x7f800000u

// Marks in `bad` the Gaussians of [first, last) with a gradient that is not finite; the work-items
// of the group share the vectors between them.
void mark_poisoned(
    const __global float* gradient, size_t first, size_t last, size_t width, __local uint* bad) {
  const __global uint* words = (const __global uint*)gradient;
  const size_t begin = first * width, end = last * width;
  uv most = (uv)(0u);
  uint rest = 0;
  size_t i = begin + get_local_id(0) * LANES;
  for (; i + LANES <= end; i += GROUP * LANES) {
    most = max(most, rs_load_words(words + i) & RS_EXPONENT);
  }
  for (; i < end; ++i) rest = max(rest, words[i] & RS_EXPONENT);
  if (rest != RS_EXPONENT && !rs_any_of(most == RS_EXPONENT)) return;
  for (i = begin + get_local_id(0) * LANES; i < end; i += GROUP * LANES) {
    for (size_t k = i; k < min(i + LANES, end); ++k) {
      if ((words[k] & RS_EXPONENT) == RS_EXPONENT) atomic_or(bad + (k / width - first), 1u);
    }
  }
}

// steps[i] is 1 where Gaussian i takes the step, else 0. Launch: GROUP work-items for every BLOCK
// Gaussians. Complexity: reads every gradient once.
__kernel void choose_steps(const __global float* means,
                           const __global float* quaternions,
                           const __global float* scales,
                           const __global float* opacities,
                           const __global float* sh,
                           const __global float* screen,
                           const __global uint* guard,
                           uint count,
                           uint sh_floats,
                           int visible_only,
                           __global uchar* steps,
                           __global uint* skipped) {
  __local uint bad[BLOCK];
  const size_t first = get_global_id(0) / GROUP * BLOCK;
  const size_t last = min(first + BLOCK, (size_t)count);
  const bool open = guard[0] == 0;
  for (uint k = get_local_id(0); k < BLOCK; k += GROUP) bad[k] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  if (open) {
    mark_poisoned(means, first, last, 3, bad);
    mark_poisoned(quaternions, first, last, 4, bad);
    mark_poisoned(scales, first, last, 3, bad);
    mark_poisoned(opacities, first, last, 1, bad);
    mark_poisoned(sh, first, last, sh_floats, bad);
  }
  barrier(CLK_LOCAL_MEM_FENCE);
  for (size_t i = first + get_local_id(0); i < last; i += GROUP) {
    const bool taken = open && (!visible_only || screen[3 * i + 2] != 0.0f);
    const bool poisoned = bad[i - first] != 0;
    steps[i] = taken && !poisoned;
    if (taken && poisoned) atomic_inc(skipped);
  }
}

// The learning rates of the floats from `phase` of a Gaussian on: of SH the first three have their
// own.
fv step_rates(int phase, const RsAdam* adam) {
#if WIDTH <= 4
  (void)phase;
  return (fv)(adam->rate);
#else
  iv place = phase + RS_LANE_INDEX;
  for (int k = 0; k < (LANES + WIDTH - 2) / WIDTH; ++k) {
    place = place >= WIDTH ? place - WIDTH : place;
  }
  return rs_pick(place < 3, adam->rate, adam->rest_rate);
#endif
}

#define RS_ADAM_UPDATE(T, load, store, pick, rates)                                     \
  const T g = load(gradient + i);                                                       \
  T m = adam->beta1 * load(first + i) + adam->rest1 * g;                                \
  m = pick(fabs(m) < RS_TINY_MOMENT, 0.0f, m);                                          \
  const T v = adam->beta2 * load(second + i) + adam->rest2 * g * g;                     \
  store(m, first + i);                                                                  \
  store(v, second + i);                                                                 \
  store(load(parameter + i) - rates * m / (sqrt(v) * adam->root_scale + adam->epsilon), \
        parameter + i)

#define rs_load_one(p) (*(p))
#define rs_store_one(value, p) (*(p) = (value))
#define rs_pick_one(condition, yes, no) ((condition) ? (yes) : (no))

void adam_run(__global float* parameter,
              const __global float* gradient,
              __global float* first,
              __global float* second,
              size_t begin,
              size_t end,
              const RsAdam* adam) {
  int phase = (int)(begin % WIDTH);
  size_t i = begin;
  for (; i + LANES <= end; i += LANES) {
    const fv rates = step_rates(phase, adam);
    RS_ADAM_UPDATE(fv, rs_load, rs_store, rs_pick, rates);
    phase = (phase + LANES) % WIDTH;
  }
  for (; i < end; ++i) {
    const float rate = WIDTH <= 4 || phase < 3 ? adam->rate : adam->rest_rate;
    RS_ADAM_UPDATE(float, rs_load_one, rs_store_one, rs_pick_one, rate);
    phase = phase + 1 == WIDTH ? 0 : phase + 1;
  }
}

// One group of parameters of `count` Gaussians. Launch: a work-item for every SPAN floats, any
// work-group size. Complexity: reads parameter, gradient and both moments once, writes all but the
// gradient: bound by memory.
__kernel void adam_step(__global float* parameter,
                        const __global float* gradient,
                        __global float* first,
                        __global float* second,
                        const __global uchar* steps,
                        uint count,
                        RsAdam adam) {
  const size_t begin = get_global_id(0) * SPAN;
  const size_t end = min(begin + SPAN, (size_t)count * WIDTH);
  if (begin >= end) return;
  const size_t lowest = begin / WIDTH, highest = (end - 1) / WIDTH;
  uint all = 1;
  for (size_t i = lowest; i <= highest; ++i) all &= steps[i];
  if (all) {
    adam_run(parameter, gradient, first, second, begin, end, &adam);
    return;
  }
  for (size_t i = lowest; i <= highest; ++i) {
    if (!steps[i]) continue;
    adam_run(parameter, gradient, first, second, max(begin, i * WIDTH), min(end, (i + 1) * WIDTH),
             &adam);
  }
}

// Row i of `to`, `width` floats, becomes row source[i] of `from`, or zeros where source[i] is
// RS_NO_SOURCE. Launch: a work-item for every `span` floats of the new rows, which are in one row.
__kernel void remap_rows(const __global float* from,
                         __global float* to,
                         const __global uint* source,
                         uint width,
                         uint span,
                         uint count) {
  const size_t first = get_global_id(0) * (size_t)span;
  if (first >= (size_t)count * width) return;
  const uint old = source[first / width];
  const __global float* row = from + (size_t)old * width + first % width;
  for (uint k = 0; k < span; ++k) to[first + k] = old == RS_NO_SOURCE ? 0.0f : row[k];
}
