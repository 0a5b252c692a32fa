// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats {

/// A message to a rank, and the room for one from a rank.
struct Outgoing {
  int to = 0;
  std::span<const std::byte> bytes;
};
struct Incoming {
  int from = 0;
  std::span<std::byte> bytes;
};

/// How a rank waits for messages: at once awake when they come, or leaving its core to others, for
/// those that may come late.
enum class Wait { kSpinning, kResting };

/// A rank that the others wait for has ended.
struct RankLost : DeviceError {
  RankLost(const std::string& message, int lost_rank) : DeviceError(message), rank(lost_rank) {}
  int rank;
};

/// How the ranks that share some work reach each other. Everything else that they do together is
/// made of exchange() (Communicator). Used by one thread of the rank at a time.
class Transport {
 public:
  virtual ~Transport() = default;
  virtual int rank() const = 0;  ///< from 0
  virtual int size() const = 0;
  /// Its place among the ranks of the same machine, from 0.
  virtual int local_rank() const = 0;
  /// Sends and receives all of these messages; blocks. What two ranks send each other arrives in
  /// order; the sizes have to agree. Throws RankLost.
  virtual void exchange(std::span<const Outgoing> out, std::span<const Incoming> in, Wait wait) = 0;
  /// Tells, from any thread, that this rank has failed: an exchange() of it throws an Error soon.
  virtual void cancel() = 0;
  /// Ends all ranks; `code` is the exit status of a process.
  [[noreturn]] virtual void abort(int code) = 0;
};

}  // namespace raysplats

/// What raysplats-mpi exports: the version that it was built with, and the transport among the
/// processes that a launcher of MPI has started; Error(kRuntime) when MPI does not start.
extern "C" const char* raysplats_mpi_version();
extern "C" raysplats::Transport* raysplats_mpi_transport();
