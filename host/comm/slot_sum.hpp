// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <functional>
#include <future>
#include <span>
#include <utility>
#include <vector>

#include "comm/communicator.hpp"
#include "comm/pairwise.hpp"
#include "comm/sparse_row.hpp"

namespace raysplats {

/// Adds `slots` rows of numbers, of which rank r has those of RankShare::of(slots, r), in the order
/// of the tree of PairwiseNode: the sums are the same bits for every number of ranks. Every rank
/// adds the numbers of an equal part of the row, of which it hears from all others, and sends its
/// sums to all. With N numbers other than 0 and one row a rank, that is 2 N (R - 1) / R numbers out
/// and as many in.
///
/// A rank sends a row for each of its nodes(). All but its last go while it makes those that
/// follow, by a thread of their own.
class SlotSum {
 public:
  /// The sums of its share that a rank sends. A share that is one node goes as two halves, so that
  /// the first is on its way while the second is made: numbers of slots that are 0 in the second
  /// need no time then that anything waits for.
  static std::vector<PairwiseNode> nodes(std::size_t slots, int rank, int ranks);

  SlotSum() = default;
  ~SlotSum();
  SlotSum(const SlotSum&) = delete;
  SlotSum& operator=(const SlotSum&) = delete;

  /// All ranks: a sum of rows of `numbers` numbers. `ranks` has to outlive this, and nothing else
  /// may be exchanged until wait().
  void begin(Communicator& ranks, std::size_t slots, std::size_t numbers);
  /// The row of the next node, which is whole once `arrive` has returned, in whatever thread. Both
  /// have to last until wait().
  void send(std::span<const float> row, std::function<void()> arrive);
  /// All ranks, MPI_Waitall: until all rows have come. Throws RankLost, and what `arrive` throws.
  void wait();
  /// All ranks: the sum of all slots.
  void finish(std::span<float> total);

 private:
  struct Row {
    PairwiseNode node;
    std::vector<float> numbers;  // of this rank's part
  };

  using Packed = std::pair<int, SparseRow*>;  // of a rank

  RankShare part_of(int rank) const { return RankShare::of(numbers_, rank, ranks_->size()); }
  Row& row_of(int rank, std::size_t round) {
    return rows_[begin_of_[static_cast<std::size_t>(rank)] + round];
  }
  std::size_t rounds_of(int rank) const {
    const auto r = static_cast<std::size_t>(rank);
    return begin_of_[r + 1] - begin_of_[r];
  }
  void exchange_round(std::size_t round, std::span<const float> own, Wait wait);
  void exchange_packed(const std::vector<Packed>& to, const std::vector<Packed>& from, Wait wait);

  Communicator* ranks_ = nullptr;
  std::size_t numbers_ = 0;
  std::vector<Row> rows_;              // of all nodes, those of rank 0 first
  std::vector<std::size_t> begin_of_;  // where those of a rank begin, and the end
  std::size_t sent_ = 0;               // of this rank's rows
  std::pair<std::span<const float>, std::function<void()>> last_;
  std::vector<SparseRow> out_, in_;  // to and from every rank; its own place is for its sums
  double beside_ = 0;                // seconds among ranks in the thread
  std::future<void> under_way_;      // rows that the thread sends
};

}  // namespace raysplats
