// SPDX-License-Identifier: Apache-2.0
// A 64-bit count in two 32-bit words, the lower first, that work-items add to; 64-bit atomics are
// an extension.
#ifndef RS_PRIMITIVES_COUNTER_H
#define RS_PRIMITIVES_COUNTER_H

void rs_count(volatile __global uint* words, const uint number) {
  const uint before = atomic_add(words, number);
  if (before + number < before) atomic_inc(words + 1);
}

#endif
