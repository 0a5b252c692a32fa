// SPDX-License-Identifier: Apache-2.0
#include "comm/communicator.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstring>
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

// The sum of a node's slots.
std::vector<float> row_of(const PairwiseNode& node, std::size_t n) {
  std::vector<float> row(n);
  for (std::size_t i = 0; i < n; ++i) row[i] = tree(node.first, node.end(), i);
  return row;
}

std::vector<float> sum_among(int ranks, std::size_t slots, std::size_t n) {
  std::vector<std::vector<float>> totals(static_cast<std::size_t>(ranks));
  run_thread_ranks(ranks, [&](Communicator& self) {
    SlotSum sum;
    std::vector<float> total(n, -1.0f);
    for (int step = 0; step < 2; ++step) {
      sum.begin(self, slots, n);
      std::vector<std::vector<float>> rows;
      for (const PairwiseNode& node : SlotSum::nodes(slots, self.rank(), self.size()))
        rows.push_back(row_of(node, n));
      for (const auto& row : rows) sum.send(row, [] {});
      sum.wait();
      sum.finish(total);
    }
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

TEST_CASE("many numbers, fewer than ranks, and none are added too") {
  const std::vector<float> many = sum_among(2, 7, 20011);
  for (std::size_t i = 0; i < many.size(); ++i) REQUIRE(many[i] == tree(0, 7, i));
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
        CHECK(self.all_reduce_or(self.rank() == root));
        CHECK_FALSE(self.all_reduce_or(false));
      }
      CHECK(self.all_reduce_min(static_cast<std::uint64_t>(10 + (self.rank() + 1) % ranks)) == 10);
      const std::vector<double> halves = self.all_gather(0.5 * self.rank());
      REQUIRE(halves.size() == static_cast<std::size_t>(ranks));
      for (int r = 0; r < ranks; ++r) CHECK(halves[static_cast<std::size_t>(r)] == 0.5 * r);
      CHECK(self.broadcast_value(ranks - 1, self.rank()) == ranks - 1);
      const std::vector<std::string> all = self.all_gather_texts(std::string(self.rank() * 3, 'a'));
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
    // The second half of the numbers of rank 0 is 0, but for one that has a sign, in a block of 4.
    std::vector<float> row(kNumbers, 1.0f), total(kNumbers);
    if (self.rank() == 0) std::fill(row.begin() + kNumbers / 2, row.end(), 0.0f);
    if (self.rank() == 0) row.back() = -0.0f;
    SlotSum sum;
    sum.begin(self, 2, kNumbers);
    sum.send(row, [] {});
    sum.wait();
    sum.finish(total);
    CHECK(total.front() == 2.0f);
    CHECK(total.back() == 1.0f);
    // Half a row to be added, and half a row of sums; before each a bit for each of its blocks.
    constexpr std::size_t kHalf = kNumbers / 2 * sizeof(float), kLast = 4 * sizeof(float);
    constexpr std::size_t kMarks = 2 * sizeof(std::uint64_t);
    const bool leads = self.leads();
    CHECK(self.traffic().sent == kMarks + kHalf + (leads ? kLast : kHalf));
    CHECK(self.traffic().received == kMarks + kHalf + (leads ? kHalf : kLast));
    CHECK(self.traffic().messages == 4);
    CHECK(self.traffic().hidden == 0);
  });
}

TEST_CASE("zeros do not go among ranks, and come back with their signs") {
  std::vector<float> row(100, 0.0f);
  SparseRow packed;
  std::vector<float> back(100, 7.0f);
  const auto pass = [&] {
    SparseRow received;
    packed.pack(row);
    received.expect(back);
    std::ranges::copy(packed.marks(), received.marks().begin());
    received.expect_numbers();
    REQUIRE(received.incoming().size() == packed.outgoing().size());
    std::ranges::copy(packed.outgoing(), received.incoming().begin());
    received.unpack();
    CHECK(std::memcmp(back.data(), row.data(), row.size() * sizeof(float)) == 0);
    return packed.outgoing().size();
  };
  CHECK(pass() == 0);
  row[17] = -0.0f;
  CHECK(pass() == 16);
  row[99] = 3.0f;  // of a block of four
  CHECK(pass() == 20);
  // A few zeros are not worth a copy.
  row.assign(100, 1.0f);
  std::fill_n(row.begin(), 16, 0.0f);
  CHECK(pass() == 100);
  CHECK(packed.outgoing().data() == row.data());
}

TEST_CASE("what is whole goes while the rest is made") {
  run_thread_ranks(2, [](Communicator& self) {
    const std::vector<float> row(1 << 16, 1.0f);
    std::vector<float> total(row.size());
    SlotSum sum;
    sum.begin(self, 4, row.size());
    REQUIRE(SlotSum::nodes(4, self.rank(), 2).size() == 2);
    sum.send(row, [] {});
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    sum.send(row, [] {});
    sum.wait();
    sum.finish(total);
    CHECK(total.back() == 4.0f);
    CHECK(self.traffic().hidden > 0);
  });
}

TEST_CASE("a rank that fails with rows on their way does not wait for the others") {
  const auto run = [] {
    run_thread_ranks(2, [](Communicator& self) {
      const std::vector<float> row(100, 1.0f);
      SlotSum sum;
      sum.begin(self, 4, row.size());
      if (self.rank() == 1) {
        sum.send(row, [] {});
        throw DataError("The second photo of rank 1 is gone");
      }
      // Rank 0 sends what rank 1 will not answer.
      sum.send(row, [] {});
      sum.send(row, [] {});
      sum.wait();
    });
  };
  CHECK_THROWS_WITH_AS(run(), "The second photo of rank 1 is gone", DataError);
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
