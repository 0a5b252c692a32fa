// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>

namespace raysplats {

/// While one lives, SIGINT and SIGTERM only set a mark that long work polls, and say so at once on
/// a terminal; a second signal ends the process as usual. One that is made while another lives, in
/// this thread or others, shares its mark and must not outlive it.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether a signal has arrived since the guard was made.
  bool requested() const;

 private:
  bool outer_ = false;  // the first of those that live
  struct sigaction previous_int_ {};
  struct sigaction previous_term_ {};
};

}  // namespace raysplats
