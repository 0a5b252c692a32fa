// SPDX-License-Identifier: Apache-2.0
#include "comm/slot_sum.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "comm/pairwise.hpp"

namespace raysplats {
namespace {

void add(std::span<float>& left, std::span<float>& right) {
  for (std::size_t i = 0; i < left.size(); ++i) left[i] += right[i];
}

}  // namespace

std::vector<PairwiseNode> pairwise_nodes(std::size_t first, std::size_t last) {
  PairwiseSum<char> sum;
  for (std::size_t slot = first; slot < last; ++slot) sum.push({slot, 0}, 0, [](char&, char&) {});
  std::vector<PairwiseNode> nodes;
  for (const auto& [node, value] : sum.parts()) nodes.push_back(node);
  return nodes;
}

void sum_slots(Communicator& ranks,
               std::size_t slots,
               std::span<const std::span<const float>> parts,
               std::span<float> total,
               std::vector<float>& room) {
  const int self = ranks.rank(), count = ranks.size();
  const auto piece = [&](int rank) { return RankShare::of(total.size(), rank, count); };
  const auto nodes_of = [&](int rank) {
    const RankShare share = RankShare::of(slots, rank, count);
    return pairwise_nodes(share.first, share.last);
  };
  const RankShare own = piece(self);

  // Rows of this rank's piece, those of rank 0 first.
  std::vector<std::pair<PairwiseNode, std::span<float>>> rows;
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  std::size_t needed = 0;
  for (int rank = 0; rank < count; ++rank) needed += nodes_of(rank).size() * own.size();
  if (room.size() < needed) room.resize(needed);
  for (int rank = 0, row = 0; rank < count; ++rank) {
    for (std::size_t k = 0; const PairwiseNode& node : nodes_of(rank)) {
      const std::span<float> here(room.data() + static_cast<std::size_t>(row++) * own.size(),
                                  own.size());
      rows.emplace_back(node, here);
      if (rank == self) {
        std::ranges::copy(parts[k].subspan(own.first, own.size()), here.begin());
      } else {
        in.push_back({rank, std::as_writable_bytes(here)});
      }
      ++k;
    }
    if (rank == self) continue;
    const RankShare theirs = piece(rank);
    for (const std::span<const float> part : parts)
      out.push_back({rank, std::as_bytes(part.subspan(theirs.first, theirs.size()))});
  }
  ranks.exchange(out, in);

  PairwiseSum<std::span<float>> sum;
  for (const auto& [node, row] : rows) sum.push(node, row, add);
  sum.finish(add);
  const std::span<float> mine = total.subspan(own.first, own.size());
  if (sum.parts().empty()) {
    std::ranges::fill(mine, 0.0f);
  } else {
    std::ranges::copy(sum.parts().front().second, mine.begin());
  }

  out.clear();
  in.clear();
  for (int rank = 0; rank < count; ++rank) {
    if (rank == self) continue;
    const RankShare theirs = piece(rank);
    out.push_back({rank, std::as_bytes(mine)});
    in.push_back({rank, std::as_writable_bytes(total.subspan(theirs.first, theirs.size()))});
  }
  ranks.exchange(out, in);
}

}  // namespace raysplats
