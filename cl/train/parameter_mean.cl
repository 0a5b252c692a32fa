// SPDX-License-Identifier: Apache-2.0
// The mean of the parameters over the last steps of a run: steps of single views leave them around
// their best values, the farther the larger the rates, and the mean lies nearer than most of them
// (Polyak and Juditsky 1992; of networks: Izmailov et al. 2018).

#include "trace/arguments.h"
#include "train/parameter_groups.h"

#define RS_TO(name) mean_##name

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
  const __global float* from = means;
  __global float* to = RS_TO(means);
  size_t i = 0, end = 0;
  RS_EACH_PARAMETER_GROUP(RS_CHOOSE_ARRAYS)
  if (i < end) to[i] += share * (from[i] - to[i]);
}
