// SPDX-License-Identifier: Apache-2.0
#include "trace/launch_budget.hpp"

#include <algorithm>

namespace raysplats {
namespace {

// Rows differ in cost, so a launch grows by steps that the next time can take back.
constexpr double kMostGrowth = 4.0;
constexpr double kMostRows = 65536.0;

}  // namespace

LaunchBudget::LaunchBudget(double milliseconds, DeviceType device)
    : seconds_(1e-3 * (milliseconds >= 0            ? milliseconds
                       : device == DeviceType::kCpu ? 0.0
                                                    : kDefault)) {}

std::uint32_t LaunchBudget::rows(std::uint32_t left) const {
  return bounded() ? std::clamp(rows_, 1u, std::max(left, 1u)) : left;
}

void LaunchBudget::record(std::uint32_t rows, double seconds) {
  const double fit = seconds > 0 ? rows * seconds_ / seconds : kMostRows;
  const double most = std::min(kMostGrowth * std::max(rows, rows_), kMostRows);
  rows_ = static_cast<std::uint32_t>(std::clamp(fit, 1.0, most));
}

}  // namespace raysplats
