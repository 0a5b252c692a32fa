// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/error.hpp"
#include "util/interrupt.hpp"

namespace raysplats {

/// For long work before a file is written: throws Error (kInterrupted) when a signal has arrived
/// while somebody holds an InterruptGuard.
inline void stop_if_interrupted() {
  if (interrupt_requested())
    throw Error(ErrorCode::kInterrupted, "Interrupted: nothing is written");
}

}  // namespace raysplats
