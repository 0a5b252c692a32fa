// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nanobind/nanobind.h>

namespace raysplats::python {

/// For the callbacks of long work, which runs without the interpreter's lock: raises what a signal
/// has asked for, KeyboardInterrupt for Ctrl-C, and else lets it go on.
inline bool heed_signals(double /*share*/) {
  const nanobind::gil_scoped_acquire acquire;
  if (PyErr_CheckSignals() != 0) throw nanobind::python_error();
  return true;
}

}  // namespace raysplats::python
