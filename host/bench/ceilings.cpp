// SPDX-License-Identifier: Apache-2.0
#include "bench/ceilings.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

namespace raysplats {
namespace {

constexpr const char* kProgram = "bench/ceilings.cl";
constexpr int kRepetitions = 5;
constexpr int kCopies = 25;
constexpr double kFmaSeconds = 0.01;
constexpr std::uint32_t kFirstRounds = 1u << 12;
constexpr std::uint32_t kMostRounds = 1u << 24;
constexpr std::size_t kGroup = 64;

using Float4 = std::array<float, 4>;
using Float16 = std::array<float, 16>;

double launch_seconds(Context& context) {
  double seconds = 0;
  for (const LaunchTime& launch : context.take_launches()) seconds += launch.seconds;
  return std::max(seconds, 1e-9);
}

double fma_rate(Context& context, int chains) {
  const bool cpu = context.device().type == DeviceType::kCpu;
  const std::size_t units = std::max<std::size_t>(1, context.device().compute_units);
  const std::size_t items = cpu ? units * 4 : units * 1024;
  Kernel kernel = context.kernel(kProgram, "fma_chains", BuildOptions().define("CHAINS", chains));
  Buffer<Float16> out(context, items, "FMA sums");
  const Range range = Range::linear(items, cpu ? 1 : kGroup);
  const auto seconds = [&](std::uint32_t rounds) {
    kernel.launch(range, out, rounds, 0.999f, 0.001f);
    return launch_seconds(context);
  };
  seconds(kFirstRounds);  // compiles for the work-group
  std::uint32_t rounds = kFirstRounds;
  double best = seconds(rounds);
  while (best < kFmaSeconds && rounds < kMostRounds) best = seconds(rounds *= 2);
  for (int i = 1; i < kRepetitions; ++i) best = std::min(best, seconds(rounds));
  return 2.0 * 16.0 * chains * rounds * static_cast<double>(items) / best;
}

}  // namespace

double measure_fma_rate(Context& context) {
  double best = 0;
  for (const int chains : {4, 8, 12}) best = std::max(best, fma_rate(context, chains));
  return best;
}

double measure_copy_bandwidth(Context& context, std::size_t wanted) {
  const DeviceInfo& device = context.device();
  const bool cpu = device.type == DeviceType::kCpu;
  const std::size_t runs = 8 * std::max<std::size_t>(1, device.compute_units);
  const std::uint64_t allowed = std::min(device.max_allocation, device.global_memory / 8);
  const auto bytes = static_cast<std::size_t>(std::min<std::uint64_t>(wanted, allowed));
  const std::size_t run = std::max<std::size_t>(1, bytes / sizeof(Float16) / runs / 2) * 2;
  const std::size_t elements = 4 * runs * run;  // float4s, a multiple of 64
  Buffer<Float4> in(context, elements, "copy source");
  Buffer<Float4> out(context, elements, "copy target");
  in.clear();
  out.clear();
  context.take_launches();
  Kernel by_runs = context.kernel(kProgram, "copy_runs");
  Kernel by_stride = context.kernel(kProgram, "copy_stride");
  Kernel in_place = context.kernel(kProgram, "rewrite_runs");
  Range stride{{elements, 1, 1}, {0, 0, 0}};
  if (!cpu) stride.local = {kGroup, 1, 1};
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kCopies; ++i) {
    by_runs.launch(Range::linear(runs, 1), in, out, static_cast<std::uint32_t>(run));
    best = std::min(best, launch_seconds(context));
    by_stride.launch(stride, in, out);
    best = std::min(best, launch_seconds(context));
    in_place.launch(Range::linear(runs, 1), out, static_cast<std::uint32_t>(run));
    best = std::min(best, launch_seconds(context));
  }
  return 2.0 * sizeof(Float4) * static_cast<double>(elements) / best;
}

}  // namespace raysplats
