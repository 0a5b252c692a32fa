// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "device/context.hpp"

namespace raysplats {

/// Rate of fused multiply-adds in registers, in FLOP/s (two each): the best of several numbers of
/// chains and repetitions. Needs a context with keep_launches, as does the next.
double measure_fma_rate(Context& context);

/// Vector instructions (16 floats) a second that are no fused multiply-adds, in four chains of
/// dependent ones; the same of whole numbers, one at a time; divisions and roots of 16 floats;
/// lines of 64 bytes read at random of a table of `bytes`. All of the whole device.
double measure_vector_rate(Context& context);
double measure_scalar_rate(Context& context);
double measure_slow_rate(Context& context);
double measure_line_rate(Context& context, std::size_t bytes);

/// Vectors of 16 floats a second that are read from near memory and begin at any float; whole ones
/// that are written there.
double measure_shifted_rate(Context& context);
double measure_parked_rate(Context& context);

/// Lines of runs of 16 of them, which lie at random in a table of `bytes`, a second.
double measure_run_rate(Context& context, std::size_t bytes);

/// Lines of 64 bytes of a table of `bytes`, each of which tells where the next one is, a second.
double measure_chase_rate(Context& context, std::size_t bytes);

/// Lines of pictures that take up `bytes` together, read tile by tile, a second.
double measure_tile_rate(Context& context, std::size_t bytes);

/// How much later than the first one the other processors take part in a launch, in seconds: 0
/// where there is one alone.
double measure_late_seconds(Context& context);

/// Words of 8 bytes written at random into a table of `bytes`, a second.
double measure_store_rate(Context& context, std::size_t bytes);

/// Bytes read and written per second by the best of two copying kernels and one that works in
/// place, best of several repetitions. `bytes` is the size of each of the two buffers, reduced to
/// what the device allows; beyond the caches it measures the memory.
double measure_copy_bandwidth(Context& context, std::size_t bytes = std::size_t{256} << 20);

}  // namespace raysplats
