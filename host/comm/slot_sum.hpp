// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "comm/communicator.hpp"

namespace raysplats {

/// All ranks: adds `slots` rows of numbers, of which rank r has those of RankShare::of(slots, r),
/// in the order of the tree of PairwiseNode: the sums are the same bits for every number of ranks.
/// `parts` are this rank's sums, one row of `total.size()` numbers for each of pairwise_nodes() of
/// its share; `total` receives the sum of all slots on every rank.
///
/// Every rank adds the numbers of an equal part of the row, of which it hears from all others, and
/// sends its sums to all: with N numbers and one node a rank, 2 N (R - 1) / R numbers out and as
/// many in. `room` holds what comes, an R-th of a row for each node, and is best kept for the next
/// call.
void sum_slots(Communicator& ranks,
               std::size_t slots,
               std::span<const std::span<const float>> parts,
               std::span<float> total,
               std::vector<float>& room);

}  // namespace raysplats
