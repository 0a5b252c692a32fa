// SPDX-License-Identifier: Apache-2.0
#include "util/interrupt.hpp"

#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <string_view>

namespace raysplats {
namespace {

// A signal handler can reach nothing but a variable of static storage. It runs in any thread, the
// driver's own among them.
std::atomic<bool> interrupted{false};
std::atomic<int> guards{0};
std::atomic<bool> announced{false};  // whether somebody sees what the handler says
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler must not take locks");

// The second signal ends the process at once, whichever of the two it is: delivered again when the
// handler returns, it meets the default action.
extern "C" void mark_interrupt(int signal) {
  if (interrupted.exchange(true)) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
    return;
  }
  if (!announced) return;
  constexpr std::string_view kText =
      "\nInterrupted: stopping as soon as what is done can be kept; once more stops at once\n";
  const int error = errno;
  // There is nothing to do where it fails.
  if (::write(STDERR_FILENO, kText.data(), kText.size()) < 0) errno = error;
  errno = error;
}

}  // namespace

InterruptGuard::InterruptGuard() : outer_(guards++ == 0) {
  if (!outer_) return;
  interrupted = false;
  announced = ::isatty(STDERR_FILENO) == 1;
  struct sigaction action {};
  action.sa_handler = mark_interrupt;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, &previous_int_);
  sigaction(SIGTERM, &action, &previous_term_);
}

InterruptGuard::~InterruptGuard() {
  --guards;
  if (!outer_) return;
  sigaction(SIGINT, &previous_int_, nullptr);
  sigaction(SIGTERM, &previous_term_, nullptr);
}

bool InterruptGuard::requested() const { return interrupted; }

}  // namespace raysplats
