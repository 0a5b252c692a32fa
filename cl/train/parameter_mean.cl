// SPDX-License-Identifier: Apache-2.0
// The mean of the parameters over the last steps of a run: steps of single views leave them around
// their best values, the farther the larger the rates, and the mean lies nearer than most of them
// (Polyak and Juditsky 1992; of networks: Izmailov et al. 2018).

// mean[i] moves by `share` of its way to parameter[i]: 1 / (samples so far, this one included). A
// guard word that is not 0 turns it off. Launch: a work-item for each of `count` floats, any group
// size.
__kernel void add_sample(uint count,
                         float share,
                         const __global float* parameter,
                         const __global uint* guard,
                         __global float* mean) {
  const size_t i = get_global_id(0);
  if (i >= count || guard[0] != 0) return;
  mean[i] += share * (parameter[i] - mean[i]);
}
