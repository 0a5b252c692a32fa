// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace raysplats {

/// What SIGPIPE does while an InterruptGuard lives.
enum class LostReader {
  kUsual,      ///< as without one: as a rule it ends the process
  kInterrupts  ///< it is a signal like SIGHUP, unless it was ignored or handled before
};

/// While one lives, SIGINT, SIGTERM and SIGHUP only set a mark that long work polls, and the first
/// two say so at once on a terminal; a second one of these two ends the process as usual. SIGHUP
/// stays ignored where it was (nohup). From the first signal on SIGPIPE is ignored for good, so
/// that the work ends well though nobody reads what it says any more. Those that live at the same
/// time, in any threads, share a mark; what signals did before the first of them they do again
/// when the last one has gone.
class InterruptGuard {
 public:
  explicit InterruptGuard(LostReader reader = LostReader::kUsual);
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

  /// Whether a signal has arrived since the first of those that live was made.
  bool requested() const;

 private:
  bool hears_pipe_;  // kInterrupts
};

/// For the begin of main(): where SIGHUP is ignored (nohup) it stays so, though drivers set
/// handlers that break off what they compile.
void keep_ignoring_hang_ups();

/// For work deep below whoever holds a guard: whether a signal has arrived since the first of those
/// that live was made. False where there is none.
bool interrupt_requested();

}  // namespace raysplats
