// SPDX-License-Identifier: Apache-2.0
// What a ray blends of a Gaussian, T alpha, that counts for nothing (TraceOptions::least_weight):
// backward passes sum by how much the rays that meet a Gaussian blend more.
#ifndef RS_TRACE_LEAST_WEIGHT_H
#define RS_TRACE_LEAST_WEIGHT_H

// Of a build, not of a launch: it would take a register through the whole pass.
#ifndef LEAST_WEIGHT
#define LEAST_WEIGHT 0.0f
#endif

#endif
