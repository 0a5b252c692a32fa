// SPDX-License-Identifier: Apache-2.0
#include "parallel/scan.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

void check_scan(Context& context, Scan& scan, std::size_t count, std::uint64_t seed) {
  CAPTURE(count);
  CounterRng rng(seed, 1);
  std::vector<std::uint32_t> input(count + 3);
  for (std::uint32_t& value : input) value = static_cast<std::uint32_t>(rng.below(50));
  Buffer<std::uint32_t> buffer(context, input.size(), "scan test");
  buffer.upload(input);
  scan.exclusive(buffer, count);
  const std::vector<std::uint32_t> output = buffer.download();
  std::vector<std::uint32_t> expected = input;
  std::uint32_t sum = 0;
  for (std::size_t i = 0; i <= count; ++i) {
    expected[i] = sum;
    sum += input[i];
  }
  CHECK(output == expected);  // what lies behind the total is untouched
}

}  // namespace

TEST_CASE("scan: the device's own shape") {
  Context context(test_device());
  Scan scan(context);
  for (const std::size_t count : {0u, 1u, 2u, 3u, 255u, 256u, 257u, 4095u, 4097u, 100001u}) {
    check_scan(context, scan, count, count);
  }
}

TEST_CASE("scan: every shape gives the same sums") {
  Context context(test_device());
  for (const std::size_t size : {1u, 2u, 64u, 256u}) {
    for (const std::size_t groups : {1u, 2u, 3u, 7u, 300u}) {
      CAPTURE(size);
      CAPTURE(groups);
      Scan scan(context, ChunkShape{groups, size, 1});
      for (const std::size_t count : {0u, 1u, 5u, 64u, 1000u, 2049u})
        check_scan(context, scan, count, 7);
    }
  }
}

TEST_CASE("scan: few elements in both forms [small] [tiny]") {
  Context context(test_device());
  for (const std::size_t size : {1u, 16u}) {
    for (const std::size_t groups : {1u, 3u}) {
      CAPTURE(size);
      CAPTURE(groups);
      Scan scan(context, ChunkShape{groups, size, 1});
      for (const std::size_t count : {0u, 1u, 5u, 64u, 131u}) check_scan(context, scan, count, 8);
    }
  }
}

TEST_CASE("scan: sums past 32 bits stop at the largest number in every shape [small]") {
  Context context(test_device());
  for (const std::size_t size : {1u, 2u, 16u}) {
    for (const std::size_t groups : {1u, 3u, 300u}) {
      CAPTURE(size);
      CAPTURE(groups);
      Scan scan(context, ChunkShape{groups, size, 1});
      constexpr std::size_t kCount = 70;
      const std::vector<std::uint32_t> input(kCount + 1, 100000001u);
      Buffer<std::uint32_t> buffer(context, input.size(), "scan test");
      buffer.upload(input);
      scan.exclusive(buffer, kCount);
      const std::vector<std::uint32_t> output = buffer.download();
      for (std::uint64_t i = 0; i <= kCount; ++i) {
        CHECK(output[i] == std::min<std::uint64_t>(i * 100000001u, Scan::kMost));
      }
    }
  }
}

TEST_CASE("scan: a buffer without room for the total is refused") {
  Context context(test_device());
  Scan scan(context);
  Buffer<std::uint32_t> buffer(context, 10, "scan test");
  CHECK_THROWS_AS(scan.exclusive(buffer, 10), UsageError);
}

TEST_CASE("chunk shape: chunks cover the elements and keep to the limits") {
  DeviceInfo cpu;
  cpu.type = DeviceType::kCpu;
  cpu.compute_units = 2;
  cpu.max_work_group_size = 4096;
  DeviceInfo gpu;
  gpu.type = DeviceType::kGpu;
  gpu.compute_units = 132;
  gpu.max_work_group_size = 128;
  CHECK(ChunkShape::for_device(cpu).group_size == 1);
  CHECK(ChunkShape::for_device(gpu).group_size == 128);
  for (const DeviceInfo& info : {cpu, gpu}) {
    const ChunkShape shape = ChunkShape::for_device(info);
    for (const std::size_t count :
         {std::size_t{0}, std::size_t{1}, std::size_t{99999}, std::size_t{50000000}}) {
      const std::size_t groups = shape.used_groups(count);
      CHECK(groups >= 1);
      CHECK(groups <= shape.groups);
      CHECK(shape.chunk(count) % shape.group_size == 0);
      CHECK(groups * shape.chunk(count) >= count);
      CHECK((groups == 1 || (groups - 1) * shape.chunk(count) < count));
    }
  }
}
