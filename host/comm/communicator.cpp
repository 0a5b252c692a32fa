// SPDX-License-Identifier: Apache-2.0
#include "comm/communicator.hpp"

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <utility>

namespace raysplats {
namespace {

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

}  // namespace

Communicator::Communicator(std::shared_ptr<Transport> transport)
    : transport_(std::move(transport)) {}

void Communicator::exchange(std::span<const Outgoing> out,
                            std::span<const Incoming> in,
                            Wait wait) {
  if (!transport_ || (out.empty() && in.empty())) return;
  const auto begin = std::chrono::steady_clock::now();
  transport_->exchange(out, in, wait);
  traffic_.seconds +=
      std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  traffic_.messages += out.size();
  for (const Outgoing& message : out) traffic_.sent += message.bytes.size();
  for (const Incoming& message : in) traffic_.received += message.bytes.size();
}

void Communicator::cancel() {
  if (transport_) transport_->cancel();
}

void Communicator::count_as_hidden(double seconds) {
  traffic_.seconds -= seconds;
  traffic_.hidden += seconds;
}

void Communicator::abort(ErrorCode code) {
  if (transport_) transport_->abort(static_cast<int>(code));
  std::_Exit(static_cast<int>(code));
}

// A binomial tree: in round k the ranks below 2^k (counted from the root) pass on what they have.
void Communicator::broadcast(std::span<std::byte> bytes, int root) {
  const int ranks = size();
  const int place = (rank() - root + ranks) % ranks;
  const auto rank_at = [&](int p) { return (p + root) % ranks; };
  for (int step = 1; step < ranks; step *= 2) {
    if (place < step && place + step < ranks) {
      const Outgoing out{rank_at(place + step), bytes};
      exchange({&out, 1}, {});
    } else if (place >= step && place < 2 * step) {
      const Incoming in{rank_at(place - step), bytes};
      exchange({}, {&in, 1});
    }
  }
}

std::vector<std::string> Communicator::all_gather_texts(const std::string& mine) {
  const int ranks = size(), self = rank();
  std::vector<std::uint64_t> sizes(static_cast<std::size_t>(ranks), mine.size());
  std::vector<std::string> all(static_cast<std::size_t>(ranks));
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  const auto each_other = [&](const auto& name) {
    out.clear();
    in.clear();
    for (int other = 0; other < ranks; ++other) {
      if (other != self) name(other, static_cast<std::size_t>(other));
    }
    exchange(out, in);
  };
  const std::uint64_t size = mine.size();
  each_other([&](int other, std::size_t i) {
    out.push_back({other, std::as_bytes(std::span(&size, 1))});
    in.push_back({other, std::as_writable_bytes(std::span(&sizes[i], 1))});
  });
  each_other([&](int other, std::size_t i) {
    all[i].resize(sizes[i]);
    out.push_back({other, bytes_of(mine)});
    in.push_back({other, std::as_writable_bytes(std::span(all[i]))});
  });
  all[static_cast<std::size_t>(self)] = mine;
  return all;
}

// By dissemination (Hensgen, Finkel and Manber 1988): after round k every rank knows of the 2^k
// ranks before it.
bool Communicator::all_reduce_or(bool mine) {
  const int ranks = size(), self = rank();
  std::byte known{static_cast<unsigned char>(mine ? 1 : 0)};
  for (int step = 1; step < ranks; step *= 2) {
    const std::byte told = known;
    std::byte heard{0};
    const Outgoing out{(self + step) % ranks, {&told, 1}};
    const Incoming in{(self - step + ranks) % ranks, {&heard, 1}};
    exchange({&out, 1}, {&in, 1});
    known |= heard;
  }
  return known != std::byte{0};
}

std::uint64_t Communicator::all_reduce_min(std::uint64_t mine) {
  return std::ranges::min(all_gather(mine));
}

void Communicator::all_gather_in_place(std::span<std::byte> row) {
  const int self = rank();
  const std::size_t size_of_piece = row.size() / static_cast<std::size_t>(size());
  const auto piece = [&](int r) {
    return row.subspan(static_cast<std::size_t>(r) * size_of_piece, size_of_piece);
  };
  std::vector<Outgoing> out;
  std::vector<Incoming> in;
  for (int other = 0; other < size(); ++other) {
    if (other == self) continue;
    out.push_back({other, piece(self)});
    in.push_back({other, piece(other)});
  }
  exchange(out, in);
}

RankShare RankShare::of(std::size_t count, int rank, int ranks) {
  const auto at = [&](int r) {
    return count * static_cast<std::size_t>(r) / static_cast<std::size_t>(ranks);
  };
  return {at(rank), at(rank + 1)};
}

}  // namespace raysplats
