// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "device/context.hpp"

namespace raysplats {

/// Buffers on their way to one row of the host's memory, one after the other, as they are when
/// everything enqueued before is done. Nothing waits for them until somebody asks.
class RowDownload {
 public:
  /// Makes `row` as long as the buffers together. Throws DeviceError when the driver refuses.
  RowDownload(Context& context,
              std::span<const Buffer<float>* const> buffers,
              const std::shared_ptr<std::vector<float>>& row);
  ~RowDownload();
  RowDownload(RowDownload&&) noexcept;
  RowDownload& operator=(RowDownload&&) noexcept;

  /// Blocks until they have come; from any thread. Throws DeviceError.
  void wait() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
