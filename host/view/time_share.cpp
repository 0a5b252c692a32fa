// SPDX-License-Identifier: Apache-2.0
#include "view/time_share.hpp"

#include <algorithm>

namespace raysplats::view {
namespace {

constexpr double kMostCredit = 0.5;  // seconds
constexpr double kMotionSeconds = 2.0;
constexpr double kMotionShare = 0.5;

}  // namespace

void TimeShare::pass(double seconds, double since_motion) {
  const bool moves = share_ > 0.0 && since_motion < kMotionSeconds;
  const double share = moves ? std::max(share_, kMotionShare) : share_;
  // A debt of pictures at rest is not to keep who begins to move waiting.
  if (moves && !moved_) credit_ = std::max(credit_, 0.0);
  moved_ = moves;
  credit_ = std::min(credit_ + share * seconds, kMostCredit);
}

}  // namespace raysplats::view
