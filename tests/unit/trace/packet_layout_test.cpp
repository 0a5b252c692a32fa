// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_layout.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cstdint>
#include <initializer_list>
#include <utility>

#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

DeviceInfo cpu(std::uint32_t vector_width) {
  DeviceInfo device;
  device.type = DeviceType::kCpu;
  device.float_vector_width = vector_width;
  return device;
}

TraceOptions width_of(int lanes, PacketShape shape = PacketShape::kAuto) {
  TraceOptions options;
  options.packet_width = lanes;
  options.packet_shape = shape;
  return options;
}

DeviceInfo gpu_of(std::uint64_t local_memory) {
  DeviceInfo device;
  device.type = DeviceType::kGpu;
  device.float_vector_width = 4;
  device.local_memory = local_memory;
  device.max_work_group_size = 256;
  return device;
}

}  // namespace

TEST_CASE("packet shape: follows the device's vectors") {
  CHECK(packet_layout(cpu(16), width_of(0)).lanes == 16);
  CHECK(packet_layout(cpu(8), width_of(0)).lanes == 16);
  CHECK(packet_layout(cpu(4), width_of(0)).lanes == 8);
  CHECK(packet_layout(cpu(2), width_of(0)).lanes == 4);
  CHECK(packet_layout(cpu(1), width_of(0)).lanes == 1);
  const DeviceInfo gpu = gpu_of(1000);  // too little local memory for groups
  CHECK(packet_layout(gpu, width_of(0)).lanes == 1);
  CHECK(packet_layout(gpu, width_of(8)).lanes == 8);
  CHECK_THROWS_AS(packet_layout(gpu, width_of(3)), UsageError);
  for (const int lanes : {1, 2, 4, 8, 16}) {
    const PacketLayout layout = packet_layout(cpu(16), width_of(lanes));
    CHECK(layout.width * layout.height == lanes);
    CHECK(layout.tile % (layout.block * layout.width) == 0);
    CHECK(layout.tile % (layout.block * layout.height) == 0);
    CHECK(layout.group == 1);
  }
}

TEST_CASE("packet shape: tiles of a picture take turns where a device has several processors") {
  const auto stretches = [](DeviceInfo device, std::uint32_t units) {
    device.compute_units = units;
    return packet_layout(device, width_of(0)).stretches;
  };
  CHECK(stretches(cpu(16), 1) == 1);
  CHECK(stretches(cpu(16), 2) == 4);
  CHECK(stretches(cpu(16), 6) == 12);
  CHECK(stretches(cpu(16), 128) == 16);
  CHECK(stretches(gpu_of(32768), 96) == 1);
}

TEST_CASE("packet shape: a tuning counts unless another width is asked for") {
  DeviceInfo device = cpu(16);
  const PacketLayout plain = packet_layout(device, width_of(16));
  device.tuning = DeviceTuning{false, 4, 64, 33, 8};
  for (const int lanes : {0, 4}) {
    const PacketLayout tuned = packet_layout(device, width_of(lanes));
    CHECK(tuned.lanes == 4);
    CHECK(tuned.tile == 64);
    CHECK(tuned.pending == 33);
    CHECK(tuned.group == 8);
  }
  const PacketLayout other = packet_layout(device, width_of(16));
  CHECK(other.lanes == 16);
  CHECK(other.tile == plain.tile);
  CHECK(other.pending == plain.pending);
  CHECK(other.group == plain.group);
}

TEST_CASE("packet shape: groups on GPUs, and where they are asked for") {
  const PacketLayout layout = packet_layout(gpu_of(32768), width_of(0));
  CHECK(layout.grouped);
  CHECK(layout.lanes == 32);
  CHECK(layout.width * layout.height == layout.lanes);
  CHECK(layout.block == 1);
  CHECK(layout.tile % layout.width == 0);
  CHECK(packet_layout(gpu_of(32768), width_of(64)).height == 8);
  DeviceInfo device = cpu(16);
  device.local_memory = 65536;
  device.max_work_group_size = 4096;
  CHECK_FALSE(packet_layout(device, width_of(0)).grouped);
  CHECK(packet_layout(device, width_of(64)).grouped);
  CHECK_FALSE(packet_layout(device, width_of(16)).grouped);
  CHECK(packet_layout(device, width_of(16, PacketShape::kGroup)).grouped);
  CHECK(packet_layout(device, width_of(0, PacketShape::kGroup)).lanes == 32);
  CHECK_FALSE(packet_layout(gpu_of(65536), width_of(0, PacketShape::kVector)).grouped);
  CHECK_THROWS_AS(packet_layout(device, width_of(4, PacketShape::kGroup)), UsageError);
  CHECK_THROWS_AS(packet_layout(device, width_of(32, PacketShape::kVector)), UsageError);
  CHECK_THROWS_AS(packet_layout(gpu_of(16000), width_of(64)), DeviceError);
  // A tuning of the other shape does not count.
  device.tuning = DeviceTuning{true, 64, 32, 48, 0};
  CHECK(packet_layout(device, width_of(0)).lanes == 64);
  CHECK(packet_layout(device, width_of(0, PacketShape::kVector)).lanes == 16);
  CHECK(packet_layout(device, width_of(0, PacketShape::kVector)).tile == 32);
}

TEST_CASE("packet shape: groups where the local memory of compiled kernels is there") {
  for (const std::uint64_t local_memory : {16384, 32768, 65536}) {
    CAPTURE(local_memory);
    DeviceInfo gpu = gpu_of(local_memory);
    CHECK(packet_layout(gpu, width_of(0)).grouped);
    CHECK(packet_layout(gpu, width_of(0)).lanes == 32);
    CHECK(packet_layout(gpu, width_of(64)).lanes == 64);
    gpu.has_subgroups = true;
    CHECK(packet_layout(gpu, width_of(0)).subgroups);
    CHECK(packet_layout(gpu, width_of(64)).lanes == 64);
  }
  CHECK_FALSE(packet_layout(gpu_of(8192), width_of(0)).grouped);
  // The largest of scripts/gpu/baseline.json and, for 8, of ForwardMemory.
  for (const auto& [lanes, bytes] : std::initializer_list<std::pair<int, std::uint64_t>>{
           {8, 2976}, {16, 4640}, {32, 7840}, {64, 15136}}) {
    const DeviceInfo device = gpu_of(bytes);
    CAPTURE(device.local_memory);
    CHECK_THROWS_AS(packet_layout(device, width_of(lanes, PacketShape::kGroup)), DeviceError);
  }
}

TEST_CASE("packet shape: subgroups where the device has them") {
  DeviceInfo gpu = gpu_of(32768);
  CHECK_FALSE(packet_layout(gpu, width_of(0)).subgroups);
  CHECK_THROWS_AS(packet_layout(gpu, width_of(0, PacketShape::kSubgroup)), DeviceError);
  gpu.has_subgroups = true;
  const PacketLayout layout = packet_layout(gpu, width_of(0));
  CHECK(layout.grouped);
  CHECK(layout.subgroups);
  CHECK_FALSE(layout.sized);  // as the compiler likes
  CHECK(layout.lanes == 32);
  const PacketLayout asked = packet_layout(gpu, width_of(16, PacketShape::kSubgroup));
  CHECK(asked.grouped);
  CHECK(asked.subgroups);
  CHECK(asked.sized);
  CHECK(asked.lanes == 16);
  CHECK_FALSE(packet_layout(gpu, width_of(0, PacketShape::kGroup)).subgroups);
  CHECK_FALSE(packet_layout(gpu, width_of(0, PacketShape::kVector)).grouped);
  CHECK_THROWS_AS(packet_layout(gpu, width_of(4, PacketShape::kSubgroup)), UsageError);
  // CPUs take them only where they are asked for.
  DeviceInfo device = cpu(16);
  device.local_memory = 65536;
  device.max_work_group_size = 4096;
  device.has_subgroups = true;
  CHECK_FALSE(packet_layout(device, width_of(0)).grouped);
  CHECK_FALSE(packet_layout(device, width_of(64)).subgroups);
  CHECK(packet_layout(device, width_of(0, PacketShape::kSubgroup)).subgroups);
}

TEST_CASE("packet shape: a tuning with subgroups and one without are two shapes") {
  DeviceInfo gpu = gpu_of(65536);
  gpu.has_subgroups = true;
  gpu.tuning = DeviceTuning{true, 16, 32, 48, 0, false, true};
  const PacketLayout tuned = packet_layout(gpu, width_of(0));
  CHECK(tuned.subgroups);
  CHECK(tuned.sized);
  CHECK(tuned.lanes == 16);
  CHECK(tuned.tile == 32);
  CHECK(tuned_shape(*gpu.tuning) == PacketShape::kSubgroup);
  const PacketLayout group = packet_layout(gpu, width_of(0, PacketShape::kGroup));
  CHECK_FALSE(group.subgroups);
  CHECK(group.lanes == 32);
  CHECK(group.tile == 16);
  gpu.tuning->subgroups = false;
  CHECK_FALSE(packet_layout(gpu, width_of(0)).subgroups);
  CHECK(packet_layout(gpu, width_of(0)).lanes == 16);
  CHECK(packet_layout(gpu, width_of(0, PacketShape::kSubgroup)).lanes == 32);
}

// In the forward and in the backward pass, eight at a time, of 64.
TEST_CASE("packet shape: open rows of crowded packets fit local memory") {
  const auto rows = [](std::uint64_t kib, int lanes) {
    return packet_layout(gpu_of(1024 * kib), width_of(lanes, PacketShape::kGroup)).crowded_rows;
  };
  CHECK(rows(16, 32) == std::array<int, 2>{24, 40});
  CHECK(rows(16, 64) == std::array<int, 2>{8, 16});
  CHECK(rows(48, 64) == std::array<int, 2>{56, 64});
  CHECK(rows(32, 32) == std::array<int, 2>{64, 64});
}

TEST_CASE("packet group: within the limits of the kernel and the tuning") {
  PacketLayout layout = packet_layout(cpu(16), width_of(16));
  layout.tile = 32;
  layout.group = 0;
  const auto size = [&](std::size_t limit) {
    const auto group = packet_group(layout, limit);
    return group[0] * group[1];
  };
  CHECK(size(4096) == 64);
  CHECK(size(40) == 32);
  CHECK(size(1) == 1);
  layout.group = 16;
  CHECK(size(4096) == 16);
  CHECK(size(8) == 8);
  layout.group = 1;
  CHECK(size(4096) == 1);
}
