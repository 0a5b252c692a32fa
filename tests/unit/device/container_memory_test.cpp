// SPDX-License-Identifier: Apache-2.0
#include "device/container_memory.hpp"

#include <doctest/doctest.h>

#include <cstdint>

#include "unit/temporary_directory.hpp"

using namespace raysplats;

namespace {

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;

}  // namespace

TEST_CASE("a CPU has no more memory than its container") {
  const TemporaryDirectory groups;
  const auto memory = [&](DeviceType type) {
    return memory_within_container(type, 64 * kGiB, groups.path());
  };
  CHECK(memory(DeviceType::kCpu) == 64 * kGiB);  // no control groups
  groups.write("memory.max", "max\n");
  CHECK(memory(DeviceType::kCpu) == 64 * kGiB);
  groups.write("memory.max", "8589934592\n");
  CHECK(memory(DeviceType::kCpu) == 8 * kGiB);
  CHECK(memory(DeviceType::kGpu) == 64 * kGiB);
  groups.write("memory.max", "137438953472\n");  // more than there is
  CHECK(memory(DeviceType::kCpu) == 64 * kGiB);
}

TEST_CASE("a CPU has no more memory than its container, told by control groups of version 1") {
  const TemporaryDirectory groups;
  groups.write("memory/memory.limit_in_bytes", "9223372036854771712\n");  // none
  CHECK(memory_within_container(DeviceType::kCpu, 64 * kGiB, groups.path()) == 64 * kGiB);
  groups.write("memory/memory.limit_in_bytes", "4294967296\n");
  CHECK(memory_within_container(DeviceType::kCpu, 64 * kGiB, groups.path()) == 4 * kGiB);
}
