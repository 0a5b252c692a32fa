// SPDX-License-Identifier: Apache-2.0
// Counts the numbers of a Gaussian-major array, from word `place` of a buffer on, that are NaN or
// infinite, and finds the first Gaussian that has one. Bits are looked at instead of values, which
// compilers may assume to be finite.
//
// Launch: work-items of `chunk` consecutive Gaussians of `width` numbers each; O(count width).
// found = {how many numbers, index of the first Gaussian}, {0, 0xffffffff} before the launch;
// integer atomics only where there is something to report, so that scheduling changes nothing.
__kernel void find_non_finite(__global const uint* restrict words,
                              __global uint* found,
                              const ulong place,
                              const uint count,
                              const uint width,
                              const uint chunk) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  uint bad = 0, first = 0xffffffffu;
  for (uint i = begin; i < end; ++i) {
    for (uint k = 0; k < width; ++k) {
      if ((words[place + i * (size_t)width + k] & 0x7f800000u) != 0x7f800000u) continue;
      ++bad;
      first = min(first, i);
    }
  }
  if (bad == 0) return;
  atomic_add(&found[0], bad);
  atomic_min(&found[1], first);
}
