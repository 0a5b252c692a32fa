// SPDX-License-Identifier: Apache-2.0
#include "trace/launch_budget.hpp"

#include <algorithm>

namespace raysplats {
namespace {

// Rows differ in cost, so a launch grows by steps that the next time can take back.
constexpr double kMostGrowth = 4.0;
constexpr double kMostRows = 65536.0;

}  // namespace

LaunchBudget::LaunchBudget(double milliseconds, DeviceType device, std::uint32_t first)
    : seconds_(1e-3 * (milliseconds >= 0            ? milliseconds
                       : device == DeviceType::kCpu ? 0.0
                                                    : kDefault)),
      rows_(first) {}

std::uint32_t LaunchBudget::rows(std::uint32_t left) {
  if (!bounded()) return left;
  while (!launches_.empty() && (!settled_ || launches_.front().timer.ready())) {
    record(launches_.front().rows, launches_.front().timer.seconds());
    launches_.pop_front();
  }
  return std::clamp(rows_, 1u, std::max(left, 1u));
}

// A launch that took too long says that those to come must be smaller, and only one as large as
// they are that they may grow: of several that ran before the first was looked at, one does.
void LaunchBudget::record(std::uint32_t rows, double seconds) {
  const double fit = seconds > 0 ? rows * limit() / seconds : kMostRows;
  const double most = std::min(kMostGrowth * rows, kMostRows);
  settled_ = settled_ || fit <= most || most == kMostRows;
  const auto size = static_cast<std::uint32_t>(std::clamp(fit, 1.0, most));
  if (seconds > limit()) {
    rows_ = std::min(rows_, size);
  } else if (rows >= rows_) {
    rows_ = size;
  }
}

void LaunchBudget::record(std::uint32_t rows, bool all, LaunchTimer timer) {
  settled_ = settled_ || all;
  launches_.push_back({rows, std::move(timer)});
}

}  // namespace raysplats
