// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "comm/transport.hpp"

namespace raysplats {

/// A rank's view of the ranks that work on one thing together: processes under MPI, threads with a
/// device each, or one rank alone. What is said of all ranks they have to call in the same order.
class Communicator {
 public:
  /// What this rank has sent, received and waited for since the start.
  struct Traffic {
    std::uint64_t sent = 0;  ///< bytes
    std::uint64_t received = 0;
    std::uint64_t messages = 0;  ///< sent
    double seconds = 0;          ///< within exchange(), while nothing else was done
    double hidden = 0;           ///< the others there
  };

  /// One rank alone.
  Communicator() = default;
  explicit Communicator(std::shared_ptr<Transport> transport);

  int rank() const { return transport_ ? transport_->rank() : 0; }
  int size() const { return transport_ ? transport_->size() : 1; }
  int local_rank() const { return transport_ ? transport_->local_rank() : 0; }
  /// Whether this rank writes files and speaks for all.
  bool leads() const { return rank() == 0; }

  /// As Transport, and counted: MPI_Irecv and MPI_Isend of all messages, then MPI_Waitall.
  void exchange(std::span<const Outgoing> out,
                std::span<const Incoming> in,
                Wait wait = Wait::kSpinning);
  /// As Transport: tells that this rank has failed. MPI has no operation for it.
  void cancel();
  /// So many of the seconds within exchange() passed beside other work of this rank.
  void count_as_hidden(double seconds);
  /// MPI_Abort.
  [[noreturn]] void abort(ErrorCode code);

  /// All ranks, MPI_Bcast: the bytes of `root` become those of all.
  void broadcast(std::span<std::byte> bytes, int root = 0);
  /// All ranks, MPI_Allgatherv: what each has, in the order of the ranks. Sizes may differ.
  std::vector<std::string> all_gather_texts(const std::string& mine);
  /// All ranks, MPI_Allgather: the values of all, in the order of the ranks.
  template <class T>
  std::vector<T> all_gather(const T& mine) {
    static_assert(std::is_trivially_copyable_v<T>);
    std::vector<T> values(static_cast<std::size_t>(size()));
    values[static_cast<std::size_t>(rank())] = mine;
    all_gather_in_place(std::as_writable_bytes(std::span(values)));
    return values;
  }
  /// All ranks, MPI_Bcast: the value of `root`.
  template <class T>
  T broadcast_value(int root, T mine) {
    static_assert(std::is_trivially_copyable_v<T>);
    broadcast(std::as_writable_bytes(std::span(&mine, 1)), root);
    return mine;
  }
  /// All ranks, MPI_Allreduce with MPI_LOR: whether any of them says so.
  bool all_reduce_or(bool mine);
  /// All ranks, MPI_Allreduce with MPI_MIN: the least of their numbers.
  std::uint64_t all_reduce_min(std::uint64_t mine);
  /// All ranks, MPI_Barrier: waits until all are here.
  void barrier() { all_reduce_or(false); }

  const Traffic& traffic() const { return traffic_; }

 private:
  // MPI_Allgather with MPI_IN_PLACE: a row of equal pieces, one a rank, each of which gives its own
  // to all others.
  void all_gather_in_place(std::span<std::byte> row);

  std::shared_ptr<Transport> transport_;  // none = alone
  Traffic traffic_;
};

/// The share of a rank in `count` things of a row: [first, last).
struct RankShare {
  std::size_t first = 0, last = 0;

  std::size_t size() const { return last - first; }
  bool holds(std::size_t i) const { return i >= first && i < last; }
  static RankShare of(std::size_t count, int rank, int ranks);
};

}  // namespace raysplats
