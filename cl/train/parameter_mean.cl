// SPDX-License-Identifier: Apache-2.0
// The mean of the parameters over the last steps of a run: steps of single views leave them around
// their best values, the farther the larger the rates, and the mean lies nearer than most of them
// (Polyak and Juditsky 1992; of networks: Izmailov et al. 2018).

#include "trace/arguments.h"
#include "train/parameter_groups.h"

// All means move by `share` of their way to the parameters: 1 / (samples so far, this one
// included). A guard word that is not 0 turns it off. Launch: a work-item for each float of `count`
// Gaussians, in groups as `parts` says.
__kernel void add_sample(uint count,
                         float share,
                         const RsParts parts,
                         const __global uint* guard,
                         RS_GAUSSIAN_ARGUMENTS,
                         __global float* mean_means,
                         __global float* mean_quaternions,
                         __global float* mean_scales,
                         __global float* mean_opacities,
                         __global float* mean_sh) {
  if (guard[0] != 0) return;
  // The arrays are chosen before one is touched: where a compiler makes masks of the conditions, it
  // would touch all five, masked out beyond their ends, which takes CPUs hundreds of cycles.
  const __global float* from = means;
  __global float* to = mean_means;
  size_t i = 0, end = 0;
#define RS_CHOOSE(number, name, width, place) \
  if (rs_works_on(parts, number)) {           \
    from = name;                              \
    to = mean_##name;                         \
    i = rs_item_of(parts, number);            \
    end = (size_t)count * width;              \
  }
  RS_EACH_PARAMETER_GROUP(RS_CHOOSE)
  if (i < end) to[i] += share * (from[i] - to[i]);
}
