// SPDX-License-Identifier: Apache-2.0
// Least depths as keys of 16 bits: the upper bits of a float, 2048 steps an octave. 32 octaves fit,
// and which these are follows a distance of the view, so that scenes in small and in large units
// are put in order as finely as others: from 2^-18 to 2^14 times that distance. Nearer depths share
// the first key, farther ones the last. Keys are numbers of steps from the first one of the view.
#ifndef RS_TRACE_DEPTH_KEY_H
#define RS_TRACE_DEPTH_KEY_H

// Bits of a float that a step leaves out.
#define RS_DEPTH_BITS 12
#define RS_DEPTH_KEYS 65536
// Octaves from the least depth with a step of its own to the distance of the view.
#define RS_DEPTH_OCTAVES 18

// The first step of a view with things as far away as `distance`: no negative number, and one from
// which all keys are finite depths.
uint first_depth_step(const float distance) {
  const int octave = (as_int(distance) >> 23) - RS_DEPTH_OCTAVES;
  return (uint)clamp(octave * (1 << (23 - RS_DEPTH_BITS)), 0,
                     (0x7f800000 >> RS_DEPTH_BITS) - RS_DEPTH_KEYS);
}

// No depth with this key is less.
float depth_bound(const uint key, const uint first_step) {
  return key == 0 ? 0.0f : as_float((key + first_step) << RS_DEPTH_BITS) * 0.9999f;
}

#endif
