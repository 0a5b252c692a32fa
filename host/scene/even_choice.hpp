// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace raysplats {

/// At most `most` of the indices below `total`, ascending and evenly spread.
inline std::vector<std::size_t> even_choice(std::size_t total, std::size_t most) {
  std::vector<std::size_t> out(std::min(total, most));
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = i * total / out.size();
  return out;
}

}  // namespace raysplats
