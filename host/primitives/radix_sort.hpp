// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"

namespace raysplats {

/// Stable least-significant-digit radix sort of 32-bit keys with 32-bit values, 8 bits a pass; few large chunks
/// on CPUs, many on GPUs. Scratch memory is kept between calls.
class RadixSort {
 public:
  explicit RadixSort(Context& context);

  /// Sorts the first `count` pairs in place by the lowest `bits` bits of the keys (a multiple of 8 is used).
  void sort(Buffer<std::uint32_t>& keys, Buffer<std::uint32_t>& values, std::size_t count, int bits = 32);

 private:
  Context* context_;
};

}  // namespace raysplats
