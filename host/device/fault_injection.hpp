// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

namespace raysplats {

/// What can be made to fail.
enum class Fault { kAllocation, kBuild, kLaunch };

/// Failures on demand, to see what becomes of a run: RAYSPLATS_FAIL_ALLOC=n,
/// RAYSPLATS_FAIL_BUILD=n and RAYSPLATS_FAIL_LAUNCH=n make the n-th buffer, program (compiled or
/// from the cache) or kernel launch of a context fail as the driver would report it. One of each
/// fails; those after it work again. Read when a context is opened.
class FaultInjection {
 public:
  FaultInjection();

  /// Counts one and throws cl::Error when it is the one to fail.
  void check(Fault fault);
  /// Whether the next check() will throw.
  bool due(Fault fault) const;

 private:
  std::array<std::size_t, 3> left_{};  // until the failure; 0 = never
};

}  // namespace raysplats
