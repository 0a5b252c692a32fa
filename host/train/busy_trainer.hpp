// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include "raysplats/error.hpp"

namespace raysplats {

/// Refuses a call of a trainer that another call trains. `calls`: which have to wait.
[[noreturn]] inline void refuse_busy_trainer(const char* calls) {
  throw UsageError(fmt::format(
      "The trainer is training already: call {} when that is over, not from its callback", calls));
}

}  // namespace raysplats
