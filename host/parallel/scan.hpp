// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "parallel/chunk_shape.hpp"

namespace raysplats {

/// Exclusive prefix sum of 32-bit unsigned integers on the device.
class Scan {
 public:
  explicit Scan(Context& context);
  /// A scan with an explicit division of the work; the result is the same for every shape.
  Scan(Context& context, const ChunkShape& shape);

  static constexpr std::uint32_t kMost = 0xffffffffu;

  /// values[i] becomes the sum of values[0..i) for i < count; values[count] becomes the total, so
  /// the buffer must hold count + 1 elements (UsageError when it does not). Sums stop at kMost: a
  /// total of kMost is one that may not fit. In place; scratch is kept between calls.
  void exclusive(Buffer<std::uint32_t>& values, std::size_t count);

 private:
  Context* context_;
  ChunkShape shape_;
  Kernel sum_chunks_;
  Kernel scan_values_;
  Buffer<std::uint32_t> sums_;
};

}  // namespace raysplats
