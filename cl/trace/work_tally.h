// SPDX-License-Identifier: Apache-2.0
// What a pass over camera rays really does, counted where it is done: for the model of speed
// (host/bench/speed_model.hpp). Only builds with COUNT_WORK 1 count; in others nothing of this is
// left. A packet's counts lie in its state and are added to the counters of the view at its end.
#ifndef RS_TRACE_WORK_TALLY_H
#define RS_TRACE_WORK_TALLY_H

#include "trace/view_sizes.h"

#ifndef COUNT_WORK
#define COUNT_WORK 0
#endif

#if COUNT_WORK
#include "parallel/counter.h"

#define RS_TALLY(owner, what, number) ((owner)->tally[what] += (uint)(number))

void tally_clear(uint* tally) {
  for (int i = 0; i < RS_TALLIES; ++i) tally[i] = 0;
}

void tally_add(const uint* tally, volatile __global uint* counters) {
  for (int i = 0; i < RS_TALLIES; ++i) rs_count(counters + RS_COUNT_WORDS + 2 * i, tally[i]);
}
#else
#define RS_TALLY(owner, what, number) ((void)0)
#endif

#endif
