// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "device/context.hpp"

namespace raysplats {

/// Rate of fused multiply-adds in registers, in FLOP/s (two each): the best of several numbers of
/// chains and repetitions. Needs a context with keep_launches, as does the next.
double measure_fma_rate(Context& context);

/// Bytes read and written per second by the best of two copying kernels and one that works in
/// place, best of several repetitions. `bytes` is the size of each of the two buffers, reduced to
/// what the device allows; beyond the caches it measures the memory.
double measure_copy_bandwidth(Context& context, std::size_t bytes = std::size_t{256} << 20);

}  // namespace raysplats
