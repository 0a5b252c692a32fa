// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

namespace raysplats {

/// What can be made to fail.
enum class Fault { kAllocation, kBuild, kLaunch, kLists, kHits };

/// Failures on demand, to see what becomes of a run: RAYSPLATS_FAIL_ALLOC=n,
/// RAYSPLATS_FAIL_BUILD=n and RAYSPLATS_FAIL_LAUNCH=n make the n-th buffer, program (compiled or
/// from the cache) or kernel launch of a context fail as the driver would report it. One of each
/// fails; those after it work again. RAYSPLATS_FAIL_LISTS=n and RAYSPLATS_FAIL_HITS=n leave the
/// n-th view that is traced without waiting for its sizes no room for its tile lists or its hits.
/// Read when a context is opened.
class FaultInjection {
 public:
  FaultInjection();

  /// The n-th from now on fails; none where n is 0.
  void arm(Fault fault, std::size_t n) { left_[static_cast<std::size_t>(fault)] = n; }
  /// Counts one and throws cl::Error when it is the one to fail.
  void check(Fault fault);
  /// Counts one and tells whether it is the one to fail.
  bool strikes(Fault fault);

 private:
  std::array<std::size_t, 5> left_{};  // until the failure; 0 = never
};

}  // namespace raysplats
