// SPDX-License-Identifier: Apache-2.0
// Adam (Kingma and Ba 2015) for the parameters of the Gaussians: first which of them take the step,
// then all groups of parameters; and the moves of its moments. The first moments of all groups lie
// in one buffer, each with room for `rows` Gaussians, and so do the second.
//
// A Gaussian with a gradient that is not finite keeps its parameters and moments and is counted;
// with visible_only so does, uncounted, one that no ray met (screen[4 i + 2] == 0). A guard word
// that is not 0 turns the whole step off (train/step_guard.cl).
#include "parallel/vector_lanes.h"
#include "train/parameter_groups.h"

// Gaussians of a work-group of choose_steps, and on CPUs of adam_step.
#ifndef BLOCK
#define BLOCK 64
#endif
// Work-items of a group: 1 on CPUs.
#ifndef GROUP
#define GROUP 1
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
    const bool taken = open && (!visible_only || screen[4 * i + 2] != 0.0f);
    const bool poisoned = bad[i - first] != 0;
    steps[i] = taken && !poisoned;
    if (taken && poisoned) atomic_inc(skipped);
  }
}

// Learning rates of a group of parameters.
typedef struct {
  float first, others;
  bool mixed;  // the first three floats of a Gaussian have their own, as of SH; else all have
} Rates;

// Those of the floats from `phase` of a Gaussian on.
fv step_rates(int phase, const Rates* rates) {
  if (!rates->mixed) return (fv)(rates->first);
  iv place = phase + RS_LANE_INDEX;
  for (int k = 0; k < (LANES + SH_FLOATS - 2) / SH_FLOATS; ++k) {
    place = place >= SH_FLOATS ? place - SH_FLOATS : place;
  }
  return rs_pick(place < 3, rates->first, rates->others);
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
              int phase,
              const Rates* rates,
              const RsAdam* adam) {
  size_t i = begin;
  for (; i + LANES <= end; i += LANES) {
    const fv rate = step_rates(phase, rates);
    RS_ADAM_UPDATE(fv, rs_load, rs_store, rs_pick, rate);
    phase = (phase + LANES) % SH_FLOATS;
  }
  for (; i < end; ++i) {
    const float rate = !rates->mixed || phase < 3 ? rates->first : rates->others;
    RS_ADAM_UPDATE(float, rs_load_one, rs_store_one, rs_pick_one, rate);
    phase = phase + 1 == SH_FLOATS ? 0 : phase + 1;
  }
}

// At most `floats` floats from number `begin` on, up to `limit`, of a group of parameters that has
// `width` of them a Gaussian.
void adam_span(__global float* parameter,
               const __global float* gradient,
               __global float* first,
               __global float* second,
               const __global uchar* steps,
               uint width,
               size_t begin,
               size_t floats,
               size_t limit,
               const Rates rates,
               const RsAdam* adam) {
  if (begin >= limit) return;
  // Compilers do not see that one float is never too many.
  const size_t end = floats == 1 ? begin + 1 : min(begin + floats, limit);
  const size_t lowest = begin / width, highest = (end - 1) / width;
  uint all = 1;
  for (size_t i = lowest; i <= highest; ++i) all &= steps[i];
  if (all) {
    const int phase = (int)(begin - lowest * width);
    adam_run(parameter, gradient, first, second, begin, end, phase, &rates, adam);
    return;
  }
  for (size_t i = lowest; i <= highest; ++i) {
    if (!steps[i]) continue;
    const size_t from = max(begin, i * width), to = min(end, (i + 1) * width);
    const int phase = (int)(from - i * width);
    adam_run(parameter, gradient, first, second, from, to, phase, &rates, adam);
  }
}

// A step of all groups of parameters of the Gaussians [begin, end). Launch: groups of GROUP
// work-items as `parts` says: on CPUs a work-item for every BLOCK Gaussians; elsewhere one for
// every LANES floats, so that neighbours touch neighbouring addresses. Complexity: reads
// parameters, gradients and both moments once, writes all but the gradients: bound by memory.
__kernel void adam_step(__global float* means,
                        __global float* quaternions,
                        __global float* scales,
                        __global float* opacities,
                        __global float* sh,
                        const __global float* g_means,
                        const __global float* g_quaternions,
                        const __global float* g_scales,
                        const __global float* g_opacities,
                        const __global float* g_sh,
                        __global float* first,
                        __global float* second,
                        const __global uchar* steps,
                        const RsParts parts,
                        const RsAdam adam) {
#if GROUP == 1
#define RS_FLOATS(width) (BLOCK * (width))
#else
#define RS_FLOATS(width) LANES
#endif
#define RS_STEP(number, name, width, place)                                                     \
  if (rs_works_on(parts, number)) {                                                             \
    const Rates rates = {adam.rates[number], adam.rates[RS_PARAMETER_GROUPS],                   \
                         number == RS_SH_GROUP && width > 3};                                   \
    const size_t row = (size_t)place * adam.rows;                                               \
    const size_t begin =                                                                        \
        adam.begin * (size_t)width + rs_item_of(parts, number) * RS_FLOATS(width);              \
    adam_span(name, g_##name, first + row, second + row, steps, width, begin, RS_FLOATS(width), \
              adam.end * (size_t)width, rates, &adam);                                          \
  }
  RS_EACH_PARAMETER_GROUP(RS_STEP)
}

// Row i of `to`, `width` floats, becomes row source[i] of `from`, or zeros where source[i] is
// RS_NO_SOURCE. The rows begin behind so many floats of either. Launch: a work-item for every
// `span` floats of the new rows, which are in one row.
__kernel void remap_rows(const __global float* from,
                         __global float* to,
                         const __global uint* source,
                         ulong from_begin,
                         ulong to_begin,
                         uint width,
                         uint span,
                         uint count) {
  const size_t first = get_global_id(0) * (size_t)span;
  if (first >= (size_t)count * width) return;
  const uint old = source[first / width];
  const __global float* row = from + from_begin + (size_t)old * width + first % width;
  for (uint k = 0; k < span; ++k) to[to_begin + first + k] = old == RS_NO_SOURCE ? 0.0f : row[k];
}
