// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

namespace raysplats {

/// First and last (exclusive) of `rows` that are part `part` of `parts` equal ones.
inline std::array<int, 2> share_of_rows(int rows, std::size_t part, std::size_t parts) {
  const auto first = [&](std::size_t p) {
    return static_cast<int>(static_cast<std::size_t>(rows) * p / parts);
  };
  return {first(part), first(part + 1)};
}

}  // namespace raysplats
