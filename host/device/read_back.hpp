// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "device/context.hpp"

namespace raysplats {

/// A copy of the first words of a buffer as they are when everything enqueued before is done, on
/// its way to the host: nothing waits for it until somebody asks. May go before it has come.
class ReadBack {
 public:
  /// Throws DeviceError when the driver refuses.
  ReadBack(Context& context, const Buffer<std::uint32_t>& buffer, std::size_t words);
  ~ReadBack();
  ReadBack(ReadBack&&) noexcept;
  ReadBack& operator=(ReadBack&&) noexcept;

  /// Whether it has come; never blocks. Throws DeviceError when the device failed on the way.
  bool ready() const;
  /// Blocks until it has come; what was enqueued later goes on meanwhile.
  const std::vector<std::uint32_t>& words() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
