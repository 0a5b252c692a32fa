// SPDX-License-Identifier: Apache-2.0
#include "process.hpp"

#include <unistd.h>

#include <atomic>

#include "raysplats/error.hpp"

namespace raysplats::python {
namespace {

std::atomic<pid_t> user{0};

}  // namespace

void require_own_process() {
  pid_t expected = 0;
  if (user.compare_exchange_strong(expected, ::getpid()) || expected == ::getpid()) return;
  throw UsageError(
      "OpenCL does not outlive a fork, and the parent of this process uses it already: start "
      "children by multiprocessing's method 'spawn', or make the first Context in the child");
}

bool is_forked() {
  const pid_t owner = user.load();
  return owner != 0 && owner != ::getpid();
}

}  // namespace raysplats::python
