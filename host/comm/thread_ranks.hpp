// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "comm/communicator.hpp"

namespace raysplats {

/// Runs `work` as `ranks` ranks, each in a thread of its own; rank 0 is the caller's. When one of
/// them throws, the others leave their next exchange() by RankLost; the first exception comes out
/// when all have ended. With one rank it is a plain call.
void run_thread_ranks(int ranks, const std::function<void(Communicator&)>& work);

}  // namespace raysplats
