// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "parallel/chunk_shape.hpp"

namespace raysplats {

/// Stable least-significant-digit radix sort of 32-bit keys with 32-bit values, 8 bits a pass; few
/// large chunks on CPUs, many on GPUs. Scratch memory is kept between calls.
class RadixSort {
  using Pair = std::array<std::uint32_t, 2>;

 public:
  /// Bytes of scratch memory.
  static constexpr std::size_t kBytesPerPair = 2 * sizeof(Pair);

  explicit RadixSort(Context& context);
  /// A sort with an explicit division of the work; the result is the same for every shape.
  RadixSort(Context& context, const ChunkShape& shape);

  /// Sorts the first `count` pairs in place by the lowest `bits` bits of the keys (rounded up to a
  /// multiple of 8, 0 to 32). The buffers may be longer. Throws UsageError when they are shorter.
  void sort(Buffer<std::uint32_t>& keys,
            Buffer<std::uint32_t>& values,
            std::size_t count,
            int bits = 32);
  /// The same for the first live[0] pairs, a number that only the device knows, of `most` at most.
  void sort(Buffer<std::uint32_t>& keys,
            Buffer<std::uint32_t>& values,
            const Buffer<std::uint32_t>& live,
            std::size_t most,
            int bits = 32);

  /// Begins to make the programs that a sort by so many bits takes.
  void begin_programs(int bits);

 private:
  struct Ends {
    const Buffer<std::uint32_t>& keys;
    const Buffer<std::uint32_t>& values;
    const Buffer<Pair>& pairs;
    Buffer<std::uint32_t>& keys_out;
    Buffer<std::uint32_t>& values_out;
    Buffer<Pair>& pairs_out;
  };
  void require_kernels(bool from_pairs, bool to_pairs);
  void pass(const Ends& ends,
            bool from_pairs,
            bool to_pairs,
            const Buffer<std::uint32_t>& live,
            std::size_t most,
            int bit);

  Context* context_;
  ChunkShape shape_;
  Kernel count_digits_[2];  // of keys, of pairs
  Kernel scan_counts_;
  Kernel scatter_[2][2];       // from keys and values or from pairs, to the same
  Buffer<std::uint32_t> all_;  // more than there can be
  Buffer<Pair> pairs_[2];
  Buffer<std::uint32_t> keys_;
  Buffer<std::uint32_t> values_;
  Buffer<std::uint32_t> counts_;  // of digits, by work-group
  Buffer<std::uint32_t> totals_;
};

}  // namespace raysplats
