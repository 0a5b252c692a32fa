// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "program.hpp"

#ifdef RAYSPLATS_MPIRUN
constexpr bool kHaveMpi = true;
#else
#define RAYSPLATS_MPIRUN ""
constexpr bool kHaveMpi = false;
#endif

/// A case that needs mpirun; one that is left out says so.
#define MPI_TEST_CASE(name) TEST_CASE(name " [mpi]" * doctest::skip(!kHaveMpi))

/// mpirun with so many processes, on a machine with fewer cores and by any user.
inline Surroundings mpirun(int ranks, std::vector<std::string> more = {}) {
  Surroundings out;
  out.launcher = {RAYSPLATS_MPIRUN, "-n",     std::to_string(ranks), "--oversubscribe", "--bind-to",
                  "none",           "--quiet"};
  out.launcher.insert(out.launcher.end(), more.begin(), more.end());
  out.environment = {{"OMPI_ALLOW_RUN_AS_ROOT", "1"},
                     {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"},
                     // Containers often forbid to read other processes' memory.
                     {"OMPI_MCA_btl_vader_single_copy_mechanism", "none"}};
  return out;
}

/// How often the program has spoken of an error.
inline std::size_t sentences(const std::string& errors) {
  std::size_t count = 0;
  for (std::size_t at = errors.find("raysplats: "); at != errors.npos;
       at = errors.find("raysplats: ", at + 1))
    ++count;
  return count;
}
