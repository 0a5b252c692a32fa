// SPDX-License-Identifier: Apache-2.0
#include "util/interrupt.hpp"

#include <unistd.h>

#include <array>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <string_view>

namespace raysplats {
namespace {

// A signal handler can reach nothing but a variable of static storage. It runs in any thread, the
// driver's own among them.
std::atomic<bool> interrupted{false};
std::atomic<bool> asked{false};  // by SIGINT or SIGTERM
std::atomic<int> guards{0};
std::atomic<bool> announced{false};  // whether somebody sees what the handler says
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler must not take locks");

// What follows is for who makes a guard or lets one go, one thread at a time.
std::mutex turn;
int pipe_guards = 0;  // those of LostReader::kInterrupts
struct Handled {
  int signal;
  struct sigaction previous;  // while there are guards
};
std::array<Handled, 3> handled{{{SIGINT, {}}, {SIGTERM, {}}, {SIGHUP, {}}}};

bool ignores_hang_ups() {
  struct sigaction present {};
  return sigaction(SIGHUP, nullptr, &present) == 0 && present.sa_handler == SIG_IGN;
}

// As the program began, by nohup. LLVM in drivers sets a handler of its own afterwards.
const bool began_ignoring = ignores_hang_ups();

using Handler = void (*)(int);

extern "C" void mark_interrupt(int signal);

// Where another one is set, by whoever uses the library, that stays.
void replace_pipe_handler(Handler from, Handler to) {
  struct sigaction present {};
  if (sigaction(SIGPIPE, nullptr, &present) == 0 && present.sa_handler == from)
    std::signal(SIGPIPE, to);
}

// What reads our output, such as tee, may have been ended by the same signal. Without a reader
// writing then fails; the default action would end the process before anything is saved.
void outlive_readers() {
  replace_pipe_handler(SIG_DFL, SIG_IGN);
  replace_pipe_handler(mark_interrupt, SIG_IGN);
}

// The second of SIGINT and SIGTERM ends the process at once, whichever of the two it is: delivered
// again when the handler returns, it meets the default action. SIGHUP and SIGPIPE do not count:
// where a terminal goes the first one comes from the system and from the shell, and SIGTERM may
// come beside it; the second one tells that a reader has gone, not that somebody is in a hurry.
extern "C" void mark_interrupt(int signal) {
  const bool from_user = signal != SIGHUP && signal != SIGPIPE;
  if (from_user && asked.exchange(true)) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
    return;
  }
  interrupted = true;
  const int error = errno;
  outlive_readers();
  constexpr std::string_view kText =
      "\nInterrupted: stopping as soon as what is done can be kept; once more stops at once\n";
  // There is nothing to do where it fails.
  if (announced && from_user && ::write(STDERR_FILENO, kText.data(), kText.size()) < 0)
    errno = error;
  errno = error;
}

}  // namespace

InterruptGuard::InterruptGuard(LostReader reader) : hears_pipe_(reader == LostReader::kInterrupts) {
  const std::lock_guard<std::mutex> guard(turn);
  const bool first = guards == 0;
  if (first) interrupted = asked = false;
  ++guards;
  if (hears_pipe_ && pipe_guards++ == 0) replace_pipe_handler(SIG_DFL, mark_interrupt);
  if (!first) return;
  announced = ::isatty(STDERR_FILENO) == 1;
  const bool deaf = began_ignoring || ignores_hang_ups();
  for (auto& [signal, previous] : handled) {
    struct sigaction action {};
    action.sa_handler = signal == SIGHUP && deaf ? SIG_IGN : mark_interrupt;
    sigemptyset(&action.sa_mask);
    action.sa_flags = SA_RESTART;
    sigaction(signal, &action, &previous);
  }
}

InterruptGuard::~InterruptGuard() {
  const std::lock_guard<std::mutex> guard(turn);
  if (hears_pipe_ && --pipe_guards == 0) replace_pipe_handler(mark_interrupt, SIG_DFL);
  if (--guards > 0) return;
  for (const auto& [signal, previous] : handled) sigaction(signal, &previous, nullptr);
}

bool InterruptGuard::requested() const { return interrupted; }

void keep_ignoring_hang_ups() {
  if (!began_ignoring) return;
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGHUP);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
}

bool interrupt_requested() { return guards > 0 && interrupted; }

}  // namespace raysplats
