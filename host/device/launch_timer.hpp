// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "device/context.hpp"

namespace raysplats {

/// Device time of what is enqueued between construction and stop(), by the device's own clock:
/// nothing waits for it. On a caller's queue that takes no times it is the host's clock, and the
/// device is waited for at both ends. One at a time per context.
class LaunchTimer {
 public:
  explicit LaunchTimer(Context& context);
  ~LaunchTimer();
  LaunchTimer(LaunchTimer&&) noexcept;
  LaunchTimer& operator=(LaunchTimer&&) noexcept;

  void stop();
  /// Whether all of it has run; never blocks. Throws DeviceError when the device failed on the way.
  bool ready() const;
  /// Time from the beginning of the first launch to the end of the last; 0 for none. Blocks until
  /// they have run; what was enqueued later goes on meanwhile.
  double seconds() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
