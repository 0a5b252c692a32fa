// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>

#include "comm/transport.hpp"

namespace raysplats {

/// What a launcher of MPI (mpirun, srun) has put into the environment of this process.
struct Launch {
  int ranks = 1;  ///< 1 also when nothing launched it
  int rank = 0;
};
Launch find_launch();

/// The transport among the processes of the launch; none where there is one alone. Loads the
/// library raysplats-mpi, which alone needs MPI. Throws UsageError when this program was built
/// without it, Error(kRuntime) when the library or MPI does not start.
std::shared_ptr<Transport> launched_transport(const Launch& launch);

}  // namespace raysplats
