// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>

namespace raysplats {

/// While one lives, SIGINT and SIGTERM only set a mark that long work polls, and say so at once on
/// a terminal; a second signal ends the process as usual. At most one at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether a signal has arrived since the guard was made.
  bool requested() const;

 private:
  struct sigaction previous_int_ {};
  struct sigaction previous_term_ {};
};

}  // namespace raysplats
