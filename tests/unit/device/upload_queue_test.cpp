// SPDX-License-Identifier: Apache-2.0
#include "device/upload_queue.hpp"

#include <doctest/doctest.h>

#include <array>
#include <vector>

#include "device/buffer.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

std::vector<std::uint32_t> random_words(std::size_t size, std::uint64_t stream) {
  CounterRng rng(5, stream);
  std::vector<std::uint32_t> out(size);
  for (std::uint32_t& word : out) word = static_cast<std::uint32_t>(4294967295.0 * rng.uniform());
  return out;
}

}  // namespace

TEST_CASE("uploads beside what runs: every command finds what was uploaded before it [small]") {
  Context context(test_device());
  UploadQueue uploads(context);
  constexpr std::size_t kRounds = 12, kMost = 5000;
  std::array<Buffer<std::uint32_t>, 2> targets;
  std::array<UploadQueue::Moment, 2> free;
  for (auto& target : targets) target = Buffer<std::uint32_t>(context, kMost, "target");
  std::vector<Buffer<std::uint32_t>> seen;
  std::vector<std::vector<std::uint32_t>> expected;
  const std::uint64_t waits = context.host_waits();
  for (std::size_t round = 0; round < kRounds; ++round) {
    const std::size_t size = round % 3 == 0 ? kMost : 1 + 31 * round;
    std::vector<std::uint32_t> source = random_words(size, round);
    expected.push_back(source);
    uploads.upload(source, targets[round % 2], free[round % 2]);
    source.assign(size, 0xdeadbeef);  // is free again
    // A few commands that read it before the next but one takes its place.
    seen.emplace_back(context, size, "seen");
    for (int again = 0; again < 3; ++again) seen.back().copy_from(targets[round % 2], size);
    free[round % 2] = uploads.moment();
  }
  CHECK(context.host_waits() == waits);
  for (std::size_t round = 0; round < kRounds; ++round) {
    CAPTURE(round);
    CHECK(seen[round].download() == expected[round]);
  }
}

TEST_CASE("uploads of nothing do nothing, and a queue may go before its buffers [small]") {
  Context context(test_device());
  Buffer<std::uint32_t> target(context, 4, "target");
  target.fill(7);
  {
    UploadQueue uploads(context);
    uploads.upload({}, target, {});
    uploads.upload(std::vector<std::uint32_t>{1, 2}, target, uploads.moment());
  }
  CHECK(target.download() == std::vector<std::uint32_t>{1, 2, 7, 7});
}
