// SPDX-License-Identifier: Apache-2.0
// What messages among the ranks of mpirun cost: every rank sends every other one messages of a
// size, all at once, as SlotSum does, and then adds rows of that size by SlotSum itself. Rank 0
// prints a row for each size: bytes out of a rank, seconds of the exchange, bytes out and seconds
// of the sum, those that a tenth of the repeats are quicker than; other work disturbs the others.
//
// usage: mpirun -n R rank_times [REPEATS]
#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <span>
#include <string>
#include <vector>

#include "comm/launcher.hpp"
#include "comm/slot_sum.hpp"

namespace {

using namespace raysplats;

constexpr std::size_t kLargest = std::size_t{64} << 20;  // bytes

template <class Work>
double quick_seconds(Communicator& ranks, int repeats, const Work& work) {
  std::vector<double> seconds;
  for (int i = 0; i < repeats; ++i) {
    ranks.barrier();
    const auto begin = std::chrono::steady_clock::now();
    work();
    seconds.push_back(
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  std::ranges::sort(seconds);
  return seconds[seconds.size() / 10];
}

void time_messages(Communicator& ranks, int repeats) {
  const int self = ranks.rank(), count = ranks.size();
  const auto others = static_cast<std::size_t>(count - 1);
  if (ranks.leads()) std::printf("bytes,seconds,sum_bytes,sum_seconds\n");
  for (std::size_t bytes = 64; bytes <= kLargest; bytes *= 4) {
    std::vector<std::byte> out(bytes), in(bytes * others);
    const double exchange = quick_seconds(ranks, repeats, [&] {
      std::vector<Outgoing> to;
      std::vector<Incoming> from;
      for (int other = 0, place = 0; other < count; ++other) {
        if (other == self) continue;
        to.push_back({other, out});
        from.push_back(
            {other, std::span(in).subspan(bytes * static_cast<std::size_t>(place++), bytes)});
      }
      ranks.exchange(to, from);
    });
    const std::vector<float> row(bytes / sizeof(float), 1.0f);
    std::vector<float> total(row.size());
    SlotSum sum;
    std::uint64_t sent = 0;
    const double adding = quick_seconds(ranks, repeats, [&] {
      const std::uint64_t begin = ranks.traffic().sent;
      sum.begin(ranks, static_cast<std::size_t>(count), row.size());
      sum.send(row, [] {});
      sum.wait();
      sum.finish(total);
      sent = ranks.traffic().sent - begin;
    });
    if (ranks.leads())
      std::printf("%zu,%.9f,%zu,%.9f\n", bytes * others, exchange, static_cast<std::size_t>(sent),
                  adding);
  }
}

}  // namespace

int main(int argc, char** argv) {
  try {
    Communicator ranks(launched_transport(find_launch()));
    if (ranks.size() == 1) {
      std::fputs("usage: mpirun -n R rank_times [REPEATS]\n", stderr);
      return 2;
    }
    time_messages(ranks, argc > 1 ? std::stoi(argv[1]) : 51);
    return 0;
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
