// SPDX-License-Identifier: Apache-2.0
#include "comm/launcher.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <charconv>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <optional>
#include <string_view>

namespace raysplats {
namespace {

std::optional<int> number(const char* name) {
  const char* text = std::getenv(name);
  if (text == nullptr) return std::nullopt;
  int value = 0;
  const auto [end, error] = std::from_chars(text, text + std::strlen(text), value);
  return error == std::errc() && *end == '\0' ? std::optional(value) : std::nullopt;
}

std::optional<int> first_of(std::initializer_list<const char*> names) {
  for (const char* name : names) {
    if (const auto value = number(name)) return value;
  }
  return std::nullopt;
}

#ifdef RAYSPLATS_HAVE_MPI

constexpr const char* kLibrary = "libraysplats-mpi.so";

[[noreturn]] void fail(const std::string& what) {
  throw Error(ErrorCode::kRuntime,
              fmt::format("The processes that mpirun has started cannot be joined: {}; set "
                          "RAYSPLATS_MPI_LIBRARY to the path of {} of version {}",
                          what, kLibrary, RAYSPLATS_VERSION));
}

// The parts that MPI loads look for its names among those of the program.
std::shared_ptr<Transport> load() {
  const char* chosen = std::getenv("RAYSPLATS_MPI_LIBRARY");
  const char* name = chosen != nullptr ? chosen : kLibrary;
  void* library = ::dlopen(name, RTLD_NOW | RTLD_GLOBAL);
  if (library == nullptr) fail(::dlerror());
  const auto version =
      reinterpret_cast<decltype(&raysplats_mpi_version)>(::dlsym(library, "raysplats_mpi_version"));
  const auto transport = reinterpret_cast<decltype(&raysplats_mpi_transport)>(
      ::dlsym(library, "raysplats_mpi_transport"));
  if (version == nullptr || transport == nullptr)
    fail(fmt::format("{} is not the library of this program", name));
  if (std::string_view(version()) != RAYSPLATS_VERSION)
    fail(fmt::format("{} is of version {}", name, version()));
  return std::shared_ptr<Transport>(transport());
}

#endif

}  // namespace

// Open MPI; MPICH, Intel MPI and Slurm's PMI; Slurm's PMIx, which says how many elsewhere.
Launch find_launch() {
  Launch launch;
  const auto rank = first_of({"OMPI_COMM_WORLD_RANK", "PMI_RANK", "PMIX_RANK"});
  const auto ranks = first_of({"OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS"});
  if (!rank || !ranks || *ranks < 2) return launch;
  return {*ranks, *rank};
}

std::shared_ptr<Transport> launched_transport(const Launch& launch) {
  if (launch.ranks == 1) return nullptr;
#ifdef RAYSPLATS_HAVE_MPI
  std::shared_ptr<Transport> transport = load();
  if (transport->size() != launch.ranks) {
    // Each would do all of the work.
    throw Error(ErrorCode::kRuntime,
                fmt::format("{} processes were started together, but this one has joined {} of "
                            "them: use the mpirun of the MPI that the program was built with",
                            launch.ranks, transport->size()));
  }
  return transport;
#else
  throw UsageError(fmt::format(
      "This program was built without MPI, and each of the {} processes that mpirun has started "
      "would do all of the work: build it with -DRAYSPLATS_MPI=ON (Debian: libopenmpi-dev), or "
      "start it without mpirun",
      launch.ranks));
#endif
}

}  // namespace raysplats
