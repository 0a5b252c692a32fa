// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

#include "raysplats/context.hpp"
#include "raysplats/device.hpp"
#include "unit/temporary_directory.hpp"

namespace raysplats {

/// The device the tests run on: RAYSPLATS_DEVICE, or the default.
inline DeviceInfo test_device() {
  const char* selector = std::getenv("RAYSPLATS_DEVICE");
  return select_device(selector == nullptr ? "" : selector);
}

inline Context make_test_context() { return Context(test_device()); }

/// One for all cases of a program that need none of their own.
inline Context& shared_test_context() {
  // Not static: at the end of the program it has to go before what a driver keeps per thread.
  thread_local Context instance(test_device());
  return instance;
}

}  // namespace raysplats
