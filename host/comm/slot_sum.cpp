// SPDX-License-Identifier: Apache-2.0
#include "comm/slot_sum.hpp"

#include <algorithm>
#include <chrono>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Numbers of a row that are added at once, so that sums of sums are still in the processor's cache.
constexpr std::size_t kTogether = 4096;

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

std::vector<PairwiseNode> SlotSum::nodes(std::size_t slots, int rank, int ranks) {
  const RankShare share = RankShare::of(slots, rank, ranks);
  std::vector<PairwiseNode> nodes = pairwise_nodes(share.first, share.last);
  if (nodes.size() != 1 || nodes.front().level == 0) return nodes;
  const PairwiseNode left{share.first, nodes.front().level - 1};
  return {left, {left.end(), left.level}};
}

// Where the rank fails while rows are on their way, the others may never send theirs.
SlotSum::~SlotSum() {
  if (!under_way_.valid()) return;
  ranks_->cancel();
  under_way_.wait();
}

void SlotSum::begin(Communicator& ranks, std::size_t slots, std::size_t numbers) {
  ranks_ = &ranks;
  numbers_ = numbers;
  sent_ = 0;
  beside_ = 0;
  const std::size_t part = part_of(ranks.rank()).size();
  out_.resize(static_cast<std::size_t>(ranks.size()));
  in_.resize(static_cast<std::size_t>(ranks.size()));
  begin_of_.clear();
  std::size_t count = 0;
  for (int rank = 0; rank < ranks.size(); ++rank) {
    begin_of_.push_back(count);
    for (const PairwiseNode& node : nodes(slots, rank, ranks.size())) {
      if (rows_.size() == count) rows_.emplace_back();
      rows_[count].node = node;
      rows_[count++].numbers.resize(part);
    }
  }
  begin_of_.push_back(count);
  rows_.resize(count);
}

void SlotSum::send(std::span<const float> row, std::function<void()> arrive) {
  if (++sent_ == rounds_of(ranks_->rank())) {
    last_ = {row, std::move(arrive)};
    return;
  }
  under_way_ =
      std::async(std::launch::async, [this, row, round = sent_ - 1, arrive = std::move(arrive),
                                      before = std::move(under_way_)]() mutable {
        if (before.valid()) before.get();
        arrive();
        const double seconds = ranks_->traffic().seconds;
        exchange_round(round, row, Wait::kResting);
        beside_ += ranks_->traffic().seconds - seconds;
      });
}

void SlotSum::wait() {
  // While it is made, the others are on their way.
  if (last_.second) last_.second();
  if (under_way_.valid()) {
    const auto begin = std::chrono::steady_clock::now();
    under_way_.get();
    const double waited =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    ranks_->count_as_hidden(std::max(0.0, beside_ - waited));
  }
  const std::size_t own = rounds_of(ranks_->rank());
  std::size_t most = 0;
  for (int rank = 0; rank < ranks_->size(); ++rank) most = std::max(most, rounds_of(rank));
  for (std::size_t round = own > 0 ? own - 1 : 0; round < most; ++round)
    exchange_round(round, last_.first, Wait::kSpinning);
  last_ = {};
}

// The rows of a round: those of the ranks that have so many.
void SlotSum::exchange_round(std::size_t round, std::span<const float> own, Wait wait) {
  const int self = ranks_->rank();
  const bool sends = round < rounds_of(self);
  const RankShare here = part_of(self);
  std::vector<Packed> to, from;
  for (int rank = 0; rank < ranks_->size(); ++rank) {
    if (rank == self) continue;
    if (sends) {
      const RankShare theirs = part_of(rank);
      to.emplace_back(rank, &out_[static_cast<std::size_t>(rank)]);
      to.back().second->pack(own.subspan(theirs.first, theirs.size()));
    }
    if (round < rounds_of(rank)) {
      from.emplace_back(rank, &in_[static_cast<std::size_t>(rank)]);
      from.back().second->expect(row_of(rank, round).numbers);
    }
  }
  exchange_packed(to, from, wait);
  for (const auto& [rank, packed] : from) packed->unpack();
  if (sends)
    std::ranges::copy(own.subspan(here.first, here.size()), row_of(self, round).numbers.begin());
}

// First which blocks there are, from which follows how many numbers. When the first have come,
// the others are ready too.
void SlotSum::exchange_packed(const std::vector<Packed>& to,
                              const std::vector<Packed>& from,
                              Wait wait) {
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  out.reserve(to.size());
  in.reserve(from.size());
  for (const auto& [rank, packed] : to) out.push_back({rank, std::as_bytes(packed->marks())});
  for (const auto& [rank, packed] : from)
    in.push_back({rank, std::as_writable_bytes(packed->marks())});
  ranks_->exchange(out, in, wait);
  out.clear();
  in.clear();
  for (const auto& [rank, packed] : to) out.push_back({rank, std::as_bytes(packed->outgoing())});
  for (const auto& [rank, packed] : from) {
    packed->expect_numbers();
    in.push_back({rank, std::as_writable_bytes(packed->incoming())});
  }
  ranks_->exchange(out, in, Wait::kSpinning);
}

void SlotSum::finish(std::span<float> total) {
  const int self = ranks_->rank();
  const RankShare own = part_of(self);
  const std::span<float> mine = total.subspan(own.first, own.size());
  for (std::size_t at = 0; at < mine.size(); at += kTogether) {
    const std::size_t count = std::min(kTogether, mine.size() - at);
    PairwiseSum<std::span<float>> sum;
    for (Row& row : rows_) sum.push(row.node, std::span(row.numbers).subspan(at, count), add);
    sum.finish(add);
    std::ranges::copy(sum.parts().front().second, mine.subspan(at, count).begin());
  }

  SparseRow& sums = out_[static_cast<std::size_t>(self)];
  sums.pack(mine);
  std::vector<Packed> to, from;
  for (int rank = 0; rank < ranks_->size(); ++rank) {
    if (rank == self) continue;
    to.emplace_back(rank, &sums);
    from.emplace_back(rank, &in_[static_cast<std::size_t>(rank)]);
    const RankShare theirs = part_of(rank);
    from.back().second->expect(total.subspan(theirs.first, theirs.size()));
  }
  exchange_packed(to, from, Wait::kSpinning);
  for (const auto& [rank, packed] : from) packed->unpack();
}

}  // namespace raysplats
