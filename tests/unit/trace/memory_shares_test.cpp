// SPDX-License-Identifier: Apache-2.0
#include "trace/memory_shares.hpp"

#include <doctest/doctest.h>

using namespace raysplats;

namespace {

constexpr std::uint64_t kGiB = std::uint64_t{1} << 30;

DeviceInfo device_with(DeviceType type, std::uint64_t memory, std::uint64_t largest) {
  DeviceInfo device;
  device.type = type;
  device.global_memory = memory;
  device.max_allocation = largest;
  return device;
}

std::size_t own_budget(const DeviceInfo& device) { return MemoryShares({}, device).all(); }

}  // namespace

TEST_CASE("memory budget: a quarter of the device's memory, from 1 to 4 GiB") {
  for (const DeviceType type :
       {DeviceType::kCpu, DeviceType::kGpu, DeviceType::kAccelerator, DeviceType::kOther}) {
    CHECK(own_budget(device_with(type, 2 * kGiB, kGiB)) == kGiB);
    CHECK(own_budget(device_with(type, 4 * kGiB, kGiB)) == kGiB);
    CHECK(own_budget(device_with(type, 10 * kGiB, 4 * kGiB)) == 5 * kGiB / 2);
    CHECK(own_budget(device_with(type, 16 * kGiB, 4 * kGiB)) == 4 * kGiB);
    CHECK(own_budget(device_with(type, 141 * kGiB, 35 * kGiB)) == 4 * kGiB);
  }
}

TEST_CASE("memory budget: its half is no larger than the device's largest buffer") {
  CHECK(own_budget(device_with(DeviceType::kGpu, 24 * kGiB, 3 * kGiB / 2)) == 3 * kGiB);
  CHECK(own_budget(device_with(DeviceType::kCpu, 24 * kGiB, kGiB / 4)) == kGiB / 2);
  const DeviceInfo device = device_with(DeviceType::kGpu, 16 * kGiB, kGiB);
  CHECK(MemoryShares({}, device).hit_streams() == kGiB);
}

TEST_CASE("memory budget: what is asked for counts, and is shared out whole") {
  const DeviceInfo device = device_with(DeviceType::kGpu, 16 * kGiB, kGiB);
  TraceOptions options;
  options.memory_budget = std::size_t{64} << 20;
  const MemoryShares shares(options, device);
  CHECK(shares.all() == options.memory_budget);
  CHECK(shares.hit_streams() + shares.tile_lists() + shares.packet_gradients() == shares.all());
}
