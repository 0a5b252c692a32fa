// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_shape.hpp"

#include <doctest/doctest.h>

#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

DeviceInfo cpu(std::uint32_t vector_width) {
  DeviceInfo device;
  device.type = DeviceType::kCpu;
  device.float_vector_width = vector_width;
  return device;
}

TraceOptions width_of(int lanes, PacketForm form = PacketForm::kAuto) {
  TraceOptions options;
  options.packet_width = lanes;
  options.packet_form = form;
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
  CHECK(packet_shape(cpu(16), width_of(0)).lanes == 16);
  CHECK(packet_shape(cpu(8), width_of(0)).lanes == 16);
  CHECK(packet_shape(cpu(4), width_of(0)).lanes == 8);
  CHECK(packet_shape(cpu(2), width_of(0)).lanes == 4);
  CHECK(packet_shape(cpu(1), width_of(0)).lanes == 1);
  const DeviceInfo gpu = gpu_of(1000);  // too little local memory for groups
  CHECK(packet_shape(gpu, width_of(0)).lanes == 1);
  CHECK(packet_shape(gpu, width_of(8)).lanes == 8);
  CHECK_THROWS_AS(packet_shape(gpu, width_of(3)), UsageError);
  for (const int lanes : {1, 2, 4, 8, 16}) {
    const PacketShape shape = packet_shape(cpu(16), width_of(lanes));
    CHECK(shape.width * shape.height == lanes);
    CHECK(shape.tile % (shape.block * shape.width) == 0);
    CHECK(shape.tile % (shape.block * shape.height) == 0);
    CHECK(shape.group == 0);
  }
}

TEST_CASE("packet shape: a tuning counts unless another width is asked for") {
  DeviceInfo device = cpu(16);
  const PacketShape plain = packet_shape(device, width_of(16));
  device.tuning = DeviceTuning{false, 4, 64, 33, 8};
  for (const int lanes : {0, 4}) {
    const PacketShape tuned = packet_shape(device, width_of(lanes));
    CHECK(tuned.lanes == 4);
    CHECK(tuned.tile == 64);
    CHECK(tuned.pending == 33);
    CHECK(tuned.group == 8);
  }
  const PacketShape other = packet_shape(device, width_of(16));
  CHECK(other.lanes == 16);
  CHECK(other.tile == plain.tile);
  CHECK(other.pending == plain.pending);
  CHECK(other.group == 0);
}

TEST_CASE("packet shape: groups on GPUs, and where they are asked for") {
  const PacketShape shape = packet_shape(gpu_of(32768), width_of(0));
  CHECK(shape.grouped);
  CHECK(shape.lanes == 32);
  CHECK(shape.width * shape.height == shape.lanes);
  CHECK(shape.block == 1);
  CHECK(shape.tile % shape.width == 0);
  CHECK(packet_shape(gpu_of(32768), width_of(64)).height == 8);
  DeviceInfo device = cpu(16);
  device.local_memory = 65536;
  device.max_work_group_size = 4096;
  CHECK_FALSE(packet_shape(device, width_of(0)).grouped);
  CHECK(packet_shape(device, width_of(64)).grouped);
  CHECK_FALSE(packet_shape(device, width_of(16)).grouped);
  CHECK(packet_shape(device, width_of(16, PacketForm::kGroup)).grouped);
  CHECK(packet_shape(device, width_of(0, PacketForm::kGroup)).lanes == 32);
  CHECK_FALSE(packet_shape(gpu_of(65536), width_of(0, PacketForm::kVector)).grouped);
  CHECK_THROWS_AS(packet_shape(device, width_of(4, PacketForm::kGroup)), UsageError);
  CHECK_THROWS_AS(packet_shape(device, width_of(32, PacketForm::kVector)), UsageError);
  CHECK_THROWS_AS(packet_shape(gpu_of(16000), width_of(64)), DeviceError);
  // A tuning of the other form does not count.
  device.tuning = DeviceTuning{true, 64, 32, 48, 0};
  CHECK(packet_shape(device, width_of(0)).lanes == 64);
  CHECK(packet_shape(device, width_of(0, PacketForm::kVector)).lanes == 16);
  CHECK(packet_shape(device, width_of(0, PacketForm::kVector)).tile == 32);
}

TEST_CASE("packet shape: subgroups where the device has them") {
  DeviceInfo gpu = gpu_of(32768);
  CHECK_FALSE(packet_shape(gpu, width_of(0)).subgroups);
  CHECK_THROWS_AS(packet_shape(gpu, width_of(0, PacketForm::kSubgroup)), DeviceError);
  gpu.has_subgroups = true;
  const PacketShape shape = packet_shape(gpu, width_of(0));
  CHECK(shape.grouped);
  CHECK(shape.subgroups);
  CHECK_FALSE(shape.sized);  // as the compiler likes
  CHECK(shape.lanes == 32);
  const PacketShape asked = packet_shape(gpu, width_of(16, PacketForm::kSubgroup));
  CHECK(asked.grouped);
  CHECK(asked.subgroups);
  CHECK(asked.sized);
  CHECK(asked.lanes == 16);
  CHECK_FALSE(packet_shape(gpu, width_of(0, PacketForm::kGroup)).subgroups);
  CHECK_FALSE(packet_shape(gpu, width_of(0, PacketForm::kVector)).grouped);
  CHECK_THROWS_AS(packet_shape(gpu, width_of(4, PacketForm::kSubgroup)), UsageError);
  // CPUs take them only where they are asked for.
  DeviceInfo device = cpu(16);
  device.local_memory = 65536;
  device.max_work_group_size = 4096;
  device.has_subgroups = true;
  CHECK_FALSE(packet_shape(device, width_of(0)).grouped);
  CHECK_FALSE(packet_shape(device, width_of(64)).subgroups);
  CHECK(packet_shape(device, width_of(0, PacketForm::kSubgroup)).subgroups);
}

TEST_CASE("packet shape: a tuning with subgroups and one without are two forms") {
  DeviceInfo gpu = gpu_of(65536);
  gpu.has_subgroups = true;
  gpu.tuning = DeviceTuning{true, 16, 32, 48, 0, false, true};
  const PacketShape tuned = packet_shape(gpu, width_of(0));
  CHECK(tuned.subgroups);
  CHECK(tuned.sized);
  CHECK(tuned.lanes == 16);
  CHECK(tuned.tile == 32);
  CHECK(tuned_form(*gpu.tuning) == PacketForm::kSubgroup);
  const PacketShape group = packet_shape(gpu, width_of(0, PacketForm::kGroup));
  CHECK_FALSE(group.subgroups);
  CHECK(group.lanes == 32);
  CHECK(group.tile == 16);
  gpu.tuning->subgroups = false;
  CHECK_FALSE(packet_shape(gpu, width_of(0)).subgroups);
  CHECK(packet_shape(gpu, width_of(0)).lanes == 16);
  CHECK(packet_shape(gpu, width_of(0, PacketForm::kSubgroup)).lanes == 32);
}

TEST_CASE("packet group: within the limits of the kernel and the tuning") {
  PacketShape shape = packet_shape(cpu(16), width_of(16));
  shape.tile = 32;
  const auto size = [&](std::size_t limit) {
    const auto group = packet_group(shape, limit);
    return group[0] * group[1];
  };
  CHECK(size(4096) == 64);
  CHECK(size(40) == 32);
  CHECK(size(1) == 1);
  shape.group = 16;
  CHECK(size(4096) == 16);
  CHECK(size(8) == 8);
  shape.group = 1;
  CHECK(size(4096) == 1);
}
