// SPDX-License-Identifier: Apache-2.0
#include "parallel/radix_sort.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <numeric>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

using Words = std::vector<std::uint32_t>;

Words random_keys(std::size_t count, std::uint64_t bound, std::uint64_t seed) {
  CounterRng rng(seed, 2);
  Words keys(count);
  for (std::uint32_t& key : keys) key = static_cast<std::uint32_t>(rng.below(bound));
  return keys;
}

// Sorts on the device and with std::stable_sort; the value of a pair is its place in the input.
void check_sort(
    Context& context, RadixSort& sorter, const Words& keys, std::size_t count, int bits = 32) {
  CAPTURE(count);
  CAPTURE(bits);
  Words values(keys.size());
  std::iota(values.begin(), values.end(), 1000u);
  Buffer<std::uint32_t> device_keys(context, keys.size(), "keys");
  Buffer<std::uint32_t> device_values(context, keys.size(), "values");
  device_keys.upload(keys);
  device_values.upload(values);
  sorter.sort(device_keys, device_values, count, bits);

  const int used_bits = (bits + 7) / 8 * 8;
  const auto mask = static_cast<std::uint32_t>((std::uint64_t{1} << used_bits) - 1);
  Words order(count);
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return (keys[a] & mask) < (keys[b] & mask);
  });
  Words expected_keys = keys;
  Words expected_values = values;
  for (std::size_t i = 0; i < count; ++i) {
    expected_keys[i] = keys[order[i]];
    expected_values[i] = values[order[i]];
  }
  CHECK(device_keys.download() == expected_keys);
  CHECK(device_values.download() == expected_values);
}

}  // namespace

TEST_CASE("radix sort: random keys of many sizes") {
  Context context(test_device());
  RadixSort sorter(context);
  for (const std::size_t count : {1u, 2u, 3u, 255u, 256u, 1001u, 4096u, 4097u, 70001u, 300007u}) {
    check_sort(context, sorter, random_keys(count, 1ull << 32, count), count);
  }
}

TEST_CASE("radix sort: sorted, reversed, equal and few distinct keys") {
  Context context(test_device());
  RadixSort sorter(context);
  const std::size_t count = 50001;
  Words keys(count);
  std::iota(keys.begin(), keys.end(), 0xfffff000u - 50001u);
  check_sort(context, sorter, keys, count);
  std::reverse(keys.begin(), keys.end());
  check_sort(context, sorter, keys, count);
  check_sort(context, sorter, Words(count, 0xffffffffu), count);
  check_sort(context, sorter, Words(count, 0u), count);
  check_sort(context, sorter, random_keys(count, 3, 5), count);
}

TEST_CASE("radix sort: part of a buffer and part of the bits") {
  Context context(test_device());
  RadixSort sorter(context);
  const Words keys = random_keys(20000, 1ull << 32, 9);
  for (const std::size_t count : {0u, 1u, 2u, 777u, 19999u})
    check_sort(context, sorter, keys, count);
  for (const int bits : {0, 1, 8, 9, 16, 20, 24, 31})
    check_sort(context, sorter, keys, 20000, bits);
}

TEST_CASE("radix sort: every division of the work gives the same result") {
  Context context(test_device());
  for (const std::size_t size : {1u, 64u, 256u}) {
    for (const std::size_t groups : {1u, 2u, 3u, 8u, 100u, 300u}) {
      CAPTURE(size);
      CAPTURE(groups);
      RadixSort sorter(context, ChunkShape{groups, size, 1});
      for (const std::size_t count : {2u, 63u, 500u, 5003u}) {
        check_sort(context, sorter, random_keys(count, 1ull << 32, count + groups), count);
        check_sort(context, sorter, random_keys(count, 5, count + groups), count, 8);
      }
    }
  }
}

// Groups of 256 take tiles of 1536 elements: sizes around both, equal keys, and a million.
TEST_CASE("radix sort: groups of work-items at the ends of their tiles and chunks") {
  Context context(test_device());
  for (const std::size_t least : {1u, 1024u, 5000u}) {
    CAPTURE(least);
    RadixSort sorter(context, ChunkShape{13, 256, least});
    for (const std::size_t count :
         {0u, 1u, 255u, 256u, 257u, 1535u, 1536u, 1537u, 13u * 1536u, 13u * 1536u + 1u}) {
      const std::size_t room = std::max<std::size_t>(count, 1);
      check_sort(context, sorter, random_keys(room, 1ull << 32, count), count);
      check_sort(context, sorter, Words(room, 0x01020304u), count);
      check_sort(context, sorter, random_keys(room, 3, count), count, 8);
    }
  }
  RadixSort sorter(context, ChunkShape{64, 256, 1024});
  check_sort(context, sorter, random_keys(1u << 20, 1ull << 32, 21), 1u << 20);
  check_sort(context, sorter, random_keys(1000003, 700, 22), 1000003, 16);
}

TEST_CASE("radix sort: one to four passes, some with one digit, in both forms [small] [tiny]") {
  Context context(test_device());
  for (const std::size_t size : {1u, 16u}) {
    CAPTURE(size);
    RadixSort sorter(context, ChunkShape{3, size, 1});
    for (const int bits : {8, 16, 24, 32}) {
      check_sort(context, sorter, random_keys(100, 1ull << 32, 3), 97, bits);
      check_sort(context, sorter, random_keys(100, 1ull << 9, 4), 97, bits);
      Words keys = random_keys(100, 1ull << 32, 5);
      for (std::uint32_t& key : keys) key = (key & 0xff00ffu) | 0x7f003400u;
      check_sort(context, sorter, keys, 97, bits);
    }
  }
}

TEST_CASE("radix sort: wrong sizes are refused") {
  Context context(test_device());
  RadixSort sorter(context);
  Buffer<std::uint32_t> ten(context, 10, "ten");
  Buffer<std::uint32_t> nine(context, 9, "nine");
  CHECK_THROWS_AS(sorter.sort(ten, nine, 10), UsageError);
  CHECK_THROWS_AS(sorter.sort(ten, ten, 5, 33), UsageError);
}

TEST_CASE("radix sort: as many pairs as only the device knows") {
  Context context(test_device());
  constexpr std::size_t kMost = 20000;
  const Words keys = random_keys(kMost, std::uint64_t{1} << 32, 19);
  Buffer<std::uint32_t> live(context, 1, "live");
  for (const ChunkShape& shape : {ChunkShape{8, 1, 4096}, ChunkShape{16, 64, 256}}) {
    RadixSort sorter(context, shape);
    for (const std::uint32_t count : {0u, 1u, 700u, 19999u, 20000u}) {
      CAPTURE(count);
      Words values(kMost);
      std::iota(values.begin(), values.end(), 0u);
      Buffer<std::uint32_t> device_keys(context, kMost, "keys");
      Buffer<std::uint32_t> device_values(context, kMost, "values");
      device_keys.upload(keys);
      device_values.upload(values);
      live.fill(count);
      sorter.sort(device_keys, device_values, live, kMost, 24);
      Words expected = values;
      std::stable_sort(expected.begin(), expected.begin() + count,
                       [&](std::uint32_t a, std::uint32_t b) {
                         return (keys[a] & 0xffffffu) < (keys[b] & 0xffffffu);
                       });
      const Words sorted = device_values.download();
      // What lies behind the live pairs is of no concern.
      CHECK(std::equal(sorted.begin(), sorted.begin() + count, expected.begin()));
    }
  }
}
