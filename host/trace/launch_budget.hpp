// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "raysplats/device.hpp"

namespace raysplats {

/// How many rows of tiles one launch may do, so that it ends within a time: the watchdogs of GPUs
/// that also draw a screen stop kernels after some seconds, and a long kernel freezes the screen.
/// The size follows the times of the launches before.
class LaunchBudget {
 public:
  /// `milliseconds` per launch; 0 = no bound, negative = none on CPUs and kDefault elsewhere.
  LaunchBudget(double milliseconds, DeviceType device);

  static constexpr double kDefault = 100.0;

  bool bounded() const { return seconds_ > 0; }
  /// Rows of the next launch when `left` are to be done; at least 1.
  std::uint32_t rows(std::uint32_t left) const;
  /// A launch of `rows` rows took `seconds`.
  void record(std::uint32_t rows, double seconds);

 private:
  double seconds_;
  std::uint32_t rows_ = 4;
};

}  // namespace raysplats
