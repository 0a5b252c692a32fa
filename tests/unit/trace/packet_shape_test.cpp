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

}  // namespace

TEST_CASE("packet shape: follows the device's vectors") {
  CHECK(packet_shape(cpu(16), 0).lanes == 16);
  CHECK(packet_shape(cpu(8), 0).lanes == 8);
  CHECK(packet_shape(cpu(1), 0).lanes == 1);
  DeviceInfo gpu;
  gpu.type = DeviceType::kGpu;
  gpu.float_vector_width = 4;
  CHECK(packet_shape(gpu, 0).lanes == 1);
  CHECK(packet_shape(gpu, 8).lanes == 8);
  CHECK_THROWS_AS(packet_shape(gpu, 3), UsageError);
  for (const int lanes : {1, 2, 4, 8, 16}) {
    const PacketShape shape = packet_shape(cpu(16), lanes);
    CHECK(shape.width * shape.height == lanes);
    CHECK(shape.tile % (shape.block * shape.width) == 0);
    CHECK(shape.tile % (shape.block * shape.height) == 0);
    CHECK(shape.group == 0);
  }
}

TEST_CASE("packet shape: a tuning counts unless another width is asked for") {
  DeviceInfo device = cpu(16);
  const PacketShape plain = packet_shape(device, 16);
  device.tuning = DeviceTuning{4, 64, 33, 8};
  for (const int lanes : {0, 4}) {
    const PacketShape tuned = packet_shape(device, lanes);
    CHECK(tuned.lanes == 4);
    CHECK(tuned.tile == 64);
    CHECK(tuned.pending == 33);
    CHECK(tuned.group == 8);
  }
  const PacketShape other = packet_shape(device, 16);
  CHECK(other.lanes == 16);
  CHECK(other.tile == plain.tile);
  CHECK(other.pending == plain.pending);
  CHECK(other.group == 0);
}

TEST_CASE("packet group: within the limits of the kernel and the tuning") {
  PacketShape shape = packet_shape(cpu(16), 16);
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
