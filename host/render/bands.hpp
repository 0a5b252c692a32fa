// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "comm/communicator.hpp"
#include "raysplats/image.hpp"

namespace raysplats {

/// All ranks: brings the rows [first, last) of a picture that each has drawn to the one that leads.
void collect_rows(Communicator& ranks, const std::array<int, 2>& rows, Image& image);

}  // namespace raysplats
