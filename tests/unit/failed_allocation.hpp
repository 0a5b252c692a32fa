// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>

#include "device/fault_injection.hpp"
#include "raysplats/context.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

/// Whether the n-th allocation of `work`, counted from 1, failed; false where it makes fewer.
inline bool fails_at(Context& context, std::size_t n, const std::function<void()>& work) {
  context.faults().arm(Fault::kAllocation, n);
  bool failed = false;
  try {
    work();
  } catch (const ResourceError&) {
    failed = true;
  }
  context.faults().arm(Fault::kAllocation, 0);
  return failed;
}

}  // namespace raysplats
