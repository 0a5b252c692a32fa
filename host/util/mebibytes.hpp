// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace raysplats {

constexpr std::size_t kMiB = std::size_t{1} << 20;  ///< bytes in the unit of budgets

inline double mib(std::size_t bytes) {
  return static_cast<double>(bytes) / static_cast<double>(kMiB);
}

}  // namespace raysplats
