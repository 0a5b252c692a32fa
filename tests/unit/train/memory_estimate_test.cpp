// SPDX-License-Identifier: Apache-2.0
#include "train/memory_estimate.hpp"

#include <doctest/doctest.h>

#include <string>

#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

DeviceInfo device_with(std::uint64_t memory, std::uint64_t allocation) {
  DeviceInfo device;
  device.name = "a device";
  device.type = DeviceType::kGpu;
  device.global_memory = memory;
  device.max_allocation = allocation;
  return device;
}

std::string refusal(const TrainOptions& options,
                    const MemoryDemand& demand,
                    const DeviceInfo& device) {
  try {
    check_memory(options, demand, device);
  } catch (const ResourceError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a run that is too large is told the most Gaussians that fit, to the last one") {
  TrainOptions options;
  options.memory_budget = 256;
  const MemoryDemand demand{5'000'000, 800 * 800, 100};
  for (const DeviceInfo& device :
       {device_with(std::uint64_t{4} << 30, std::uint64_t{1} << 30),
        device_with(std::uint64_t{64} << 30, std::uint64_t{200} << 20)}) {
    const std::size_t most = gaussians_that_fit(options, demand, device);
    CHECK(most > 100'000);
    CHECK(most < demand.gaussians);
    CHECK(fits(estimate_memory(options, {most, demand.pixels, demand.views}, device), device));
    CHECK(!fits(estimate_memory(options, {most + 1, demand.pixels, demand.views}, device), device));
    CHECK(refusal(options, demand, device).find("--max-gaussians " + std::to_string(most)) !=
          std::string::npos);
    CHECK(refusal(options, {most, demand.pixels, demand.views}, device).empty());
  }
}

TEST_CASE("when not even the images fit, the advice is another") {
  const DeviceInfo tiny = device_with(64 << 20, 64 << 20);
  const std::string message = refusal({}, {1000, 4000 * 3000, 100}, tiny);
  CHECK(message.find("--downscale") != std::string::npos);
  CHECK(message.find("--max-gaussians") == std::string::npos);
}

TEST_CASE("hit lists count up to their budget, exact sums where they may be used") {
  const DeviceInfo gpu = device_with(std::uint64_t{8} << 30, std::uint64_t{2} << 30);
  DeviceInfo cpu = gpu;
  cpu.type = DeviceType::kCpu;
  TrainOptions options;
  const MemoryDemand demand{100'000, 1'000'000, 10};
  options.memory_budget = 512;
  CHECK(estimate_memory(options, demand, gpu).hits == std::size_t{512} << 20);
  options.max_hits = 2;
  options.deterministic = true;
  CHECK(estimate_memory(options, demand, gpu).hits == 24'000'000);
  const std::size_t exact = estimate_memory(options, demand, gpu).tracing;
  CHECK(exact == estimate_memory(options, demand, cpu).tracing + 320 * demand.gaussians);
  options.deterministic = false;
  CHECK(exact == estimate_memory(options, demand, gpu).tracing + 320 * demand.gaussians);
  options.gradient_sum = GradientSum::kExact;
  CHECK(exact == estimate_memory(options, demand, cpu).tracing);
}
