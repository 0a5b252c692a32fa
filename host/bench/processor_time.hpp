// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "device/context.hpp"

namespace raysplats {

/// How much of the processors of a CPU device this process had while something ran: others may
/// share them, and what waits for a processor is not slow. Other devices have all of themselves.
class ProcessorTime {
 public:
  explicit ProcessorTime(const Context& context);

  /// Since construction, of `seconds` on all of the device's units, at most 1.
  double share(double seconds) const;

 private:
  double units_;  ///< 0: not a CPU
  double begin_;
};

}  // namespace raysplats
