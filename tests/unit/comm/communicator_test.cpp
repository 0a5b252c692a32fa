// SPDX-License-Identifier: Apache-2.0
#include "comm/communicator.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <string>
#include <thread>
#include <vector>

#include "comm/pairwise.hpp"
#include "comm/slot_sum.hpp"
#include "comm/thread_ranks.hpp"

using namespace raysplats;

namespace {

// Numbers whose sum depends on the order of adding.
float number(std::size_t slot, std::size_t i) {
  const std::uint32_t mixed = static_cast<std::uint32_t>(slot * 2654435761u + i * 40503u) ^ 0x5bd1u;
  return static_cast<float>(mixed % 1000003u) * (i % 3 == 0 ? 1e-3f : 1e4f) -
         static_cast<float>(slot);
}

// The same tree by recursion over halves: the left one is the largest power of two.
float tree(std::size_t first, std::size_t last, std::size_t i) {
  if (last - first == 1) return number(first, i);
  std::size_t half = 1;
  while (2 * half < last - first) half *= 2;
  return tree(first, first + half, i) + tree(first + half, last, i);
}

// The rows of a rank's slots, added as far as its share goes.
std::vector<std::vector<float>> own_rows(std::size_t slots,
                                         const Communicator& ranks,
                                         std::size_t n) {
  PairwiseSum<std::vector<float>> sum;
  const RankShare share = RankShare::of(slots, ranks.rank(), ranks.size());
  for (std::size_t slot = share.first; slot < share.last; ++slot) {
    std::vector<float> row(n);
    for (std::size_t i = 0; i < n; ++i) row[i] = number(slot, i);
    sum.push({slot, 0}, std::move(row), [](std::vector<float>& a, const std::vector<float>& b) {
      for (std::size_t i = 0; i < a.size(); ++i) a[i] += b[i];
    });
  }
  std::vector<std::vector<float>> rows;
  for (auto& [node, row] : sum.take()) rows.push_back(std::move(row));
  return rows;
}

std::vector<float> sum_among(int ranks, std::size_t slots, std::size_t n) {
  std::vector<std::vector<float>> totals(static_cast<std::size_t>(ranks));
  run_thread_ranks(ranks, [&](Communicator& self) {
    const auto rows = own_rows(slots, self, n);
    CHECK(rows.size() == pairwise_nodes(RankShare::of(slots, self.rank(), self.size()).first,
                                        RankShare::of(slots, self.rank(), self.size()).last)
                             .size());
    const std::vector<std::span<const float>> parts(rows.begin(), rows.end());
    std::vector<float> total(n, -1.0f), room;
    sum_slots(self, slots, parts, total, room);
    totals[static_cast<std::size_t>(self.rank())] = total;
  });
  for (const std::vector<float>& total : totals) CHECK(total == totals.front());
  return totals.front();
}

}  // namespace

TEST_CASE("slots are added in one order, however many ranks share them") {
  for (const std::size_t slots : {1u, 2u, 3u, 4u, 5u, 7u, 8u, 13u}) {
    CAPTURE(slots);
    constexpr std::size_t kNumbers = 41;
    std::vector<float> expected;
    for (std::size_t i = 0; i < kNumbers; ++i) expected.push_back(tree(0, slots, i));
    for (int ranks = 1; ranks <= 5; ++ranks) {
      CAPTURE(ranks);
      CHECK(sum_among(ranks, slots, kNumbers) == expected);
    }
  }
  // The numbers tell the tree from other orders.
  int others = 0;
  for (std::size_t i = 0; i < 41; ++i) {
    float in_a_row = 0;
    for (std::size_t slot = 0; slot < 13; ++slot) in_a_row += number(slot, i);
    others += in_a_row != tree(0, 13, i);
  }
  CHECK(others > 10);
}

TEST_CASE("fewer numbers than ranks, and none, are added too") {
  CHECK(sum_among(4, 4, 2) == std::vector<float>{tree(0, 4, 0), tree(0, 4, 1)});
  CHECK(sum_among(3, 6, 0).empty());
}

TEST_CASE("what ranks say reaches all, whoever says it") {
  for (int ranks = 1; ranks <= 6; ++ranks) {
    CAPTURE(ranks);
    run_thread_ranks(ranks, [&](Communicator& self) {
      for (int root = 0; root < ranks; ++root) {
        std::vector<int> values(100, self.rank() == root ? 7 + root : -1);
        self.broadcast(std::as_writable_bytes(std::span(values)), root);
        CHECK(values == std::vector<int>(100, 7 + root));
        CHECK(self.any(self.rank() == root));
        CHECK_FALSE(self.any(false));
      }
      CHECK(self.least(static_cast<std::uint64_t>(10 + (self.rank() + 1) % ranks)) == 10);
      const std::vector<double> halves = self.all(0.5 * self.rank());
      REQUIRE(halves.size() == static_cast<std::size_t>(ranks));
      for (int r = 0; r < ranks; ++r) CHECK(halves[static_cast<std::size_t>(r)] == 0.5 * r);
      CHECK(self.said_by(ranks - 1, self.rank()) == ranks - 1);
      const std::vector<std::string> all = self.gather(std::string(self.rank() * 3, 'a'));
      REQUIRE(all.size() == static_cast<std::size_t>(ranks));
      for (std::size_t i = 0; i < all.size(); ++i) CHECK(all[i] == std::string(i * 3, 'a'));
    });
  }
}

TEST_CASE("a barrier holds until the last rank is there") {
  std::atomic<int> arrived = 0;
  run_thread_ranks(4, [&](Communicator& self) {
    if (self.rank() == 3) std::this_thread::sleep_for(std::chrono::milliseconds(50));
    ++arrived;
    self.barrier();
    CHECK(arrived == 4);
  });
}

TEST_CASE("traffic counts what goes out and comes in") {
  constexpr std::size_t kNumbers = 1000;
  run_thread_ranks(2, [&](Communicator& self) {
    const auto rows = own_rows(2, self, kNumbers);
    const std::vector<std::span<const float>> parts(rows.begin(), rows.end());
    std::vector<float> total(kNumbers), room;
    sum_slots(self, 2, parts, total, room);
    // Half a row to be added, and half a row of sums.
    CHECK(self.traffic().sent == kNumbers * sizeof(float));
    CHECK(self.traffic().received == kNumbers * sizeof(float));
    CHECK(self.traffic().messages == 2);
  });
}

TEST_CASE("when a rank fails the others stop waiting, and its error comes out") {
  std::atomic<int> lost = 0;
  const auto run = [&] {
    run_thread_ranks(4, [&](Communicator& self) {
      std::vector<std::byte> bytes(1 << 20);
      if (self.rank() == 2) {
        self.broadcast(bytes);
        throw DataError("The photo of rank 2 is gone");
      }
      try {  // rank 3 may still be waiting for its copy then
        self.broadcast(bytes);
        for (;;) self.barrier();
      } catch (const RankLost& error) {
        CHECK(error.rank == 2);
        ++lost;
        throw;
      }
    });
  };
  CHECK_THROWS_WITH_AS(run(), "The photo of rank 2 is gone", DataError);
  CHECK(lost == 3);
}

TEST_CASE("messages of sizes that do not agree are an error, no overrun") {
  const auto run = [] {
    run_thread_ranks(2, [](Communicator& self) {
      std::vector<std::byte> bytes(self.rank() == 0 ? 8 : 16);
      self.broadcast(bytes);
    });
  };
  CHECK_THROWS_WITH_AS(run(), "Rank 1 expects 16 bytes of rank 0, which sends 8", Error);
}
