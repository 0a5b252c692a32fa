// SPDX-License-Identifier: Apache-2.0
#include "bench/ceilings.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "bench/processor_time.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "bench/ceilings.cl";
constexpr int kRepetitions = 25;
constexpr int kCopies = 25;
constexpr double kFmaSeconds = 0.003;  // short: others may share the processors
constexpr std::uint32_t kFirstRounds = 1u << 12;
constexpr std::uint32_t kMostRounds = 1u << 24;
constexpr std::size_t kGroup = 64;
constexpr std::size_t kNear = 2048;    // floats, which fit the nearest cache twice
constexpr double kChainSteps = 4 * 4;  // of vector_steps and scalar_steps, a round

using Float4 = std::array<float, 4>;
using Float16 = std::array<float, 16>;

double launch_seconds(Context& context) {
  double seconds = 0;
  for (const LaunchTime& launch : context.take_launches()) seconds += launch.seconds;
  return std::max(seconds, 1e-9);
}

std::size_t chain_items(const DeviceInfo& device) {
  const std::size_t units = std::max<std::size_t>(1, device.compute_units);
  return device.type == DeviceType::kCpu ? units * 16 : units * 1024;
}

Range chain_range(const DeviceInfo& device) {
  return Range::linear(chain_items(device), device.type == DeviceType::kCpu ? 1 : kGroup);
}

// Rounds a second, of all work-items together, that `launch(rounds)` does.
double round_rate(Context& context, const std::function<void(std::uint32_t)>& launch) {
  const auto seconds = [&](std::uint32_t rounds) {
    const ProcessorTime processors(context);
    launch(rounds);
    const double spent = launch_seconds(context);
    return spent * processors.share(spent);
  };
  seconds(kFirstRounds);  // compiles for the work-group
  std::uint32_t rounds = kFirstRounds;
  double best = seconds(rounds);
  while (best < kFmaSeconds && rounds < kMostRounds) best = seconds(rounds *= 2);
  for (int i = 1; i < kRepetitions; ++i) best = std::min(best, seconds(rounds));
  return static_cast<double>(rounds) * static_cast<double>(chain_items(context.device())) / best;
}

double fma_rate(Context& context, int chains) {
  Kernel kernel = context.kernel(kProgram, "fma_chains", BuildOptions().define("CHAINS", chains));
  Buffer<Float16> out(context, chain_items(context.device()), "FMA sums");
  return 2.0 * 16.0 * chains * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), out, rounds, 0.999f, 0.001f);
         });
}

}  // namespace

double measure_fma_rate(Context& context) {
  double best = 0;
  for (const int chains : {4, 8, 12}) best = std::max(best, fma_rate(context, chains));
  return best;
}

double measure_vector_rate(Context& context) {
  Kernel kernel = context.kernel(kProgram, "vector_steps");
  Buffer<Float16> out(context, chain_items(context.device()), "sums of steps");
  return kChainSteps * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), out, rounds, 0.999f, 0.001f);
         });
}

double measure_scalar_rate(Context& context) {
  Kernel kernel = context.kernel(kProgram, "scalar_steps");
  Buffer<std::uint32_t> out(context, chain_items(context.device()), "sums of steps");
  return kChainSteps * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), out, rounds, 77u);
         });
}

double measure_slow_rate(Context& context) {
  Kernel kernel = context.kernel(kProgram, "slow_steps");
  Buffer<Float16> out(context, chain_items(context.device()), "sums of steps");
  return 8.0 * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), out, rounds, 0.999f);
         });
}

double measure_shifted_rate(Context& context) {
  Kernel kernel = context.kernel(kProgram, "shifted_reads");
  Buffer<float> table(context, kNear + 2 * 16, "shifted vectors");
  Buffer<Float16> out(context, chain_items(context.device()), "sums of vectors");
  table.clear();
  context.take_launches();
  return 4 * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), table, out, rounds,
                         static_cast<std::uint32_t>(kNear - 1));
         });
}

double measure_parked_rate(Context& context) {
  Kernel kernel = context.kernel(kProgram, "parked_vectors");
  constexpr std::size_t kGroups = kNear / 64;
  Buffer<Float16> lines(context, 4 * kGroups * chain_items(context.device()), "parked vectors");
  return 4 * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), lines, rounds,
                         static_cast<std::uint32_t>(kGroups - 1), 0.5f);
         });
}

double measure_line_rate(Context& context, std::size_t bytes) {
  const std::size_t lines = std::bit_floor(std::max<std::size_t>(1, bytes / sizeof(Float16)));
  Kernel kernel = context.kernel(kProgram, "random_lines");
  Buffer<Float16> table(context, lines, "random lines");
  Buffer<Float16> out(context, chain_items(context.device()), "sums of lines");
  table.clear();
  context.take_launches();
  return round_rate(context, [&](std::uint32_t rounds) {
    kernel.launch(chain_range(context.device()), table, out, rounds,
                  static_cast<std::uint32_t>(lines - 1));
  });
}

double measure_run_rate(Context& context, std::size_t bytes) {
  const std::size_t runs = std::bit_floor(std::max<std::size_t>(1, bytes / sizeof(Float16) / 16));
  Kernel kernel = context.kernel(kProgram, "random_runs");
  Buffer<Float16> table(context, 16 * runs, "random runs");
  Buffer<Float16> out(context, chain_items(context.device()), "sums of runs");
  table.clear();
  context.take_launches();
  return 16 * round_rate(context, [&](std::uint32_t rounds) {
           kernel.launch(chain_range(context.device()), table, out, rounds,
                         static_cast<std::uint32_t>(runs - 1));
         });
}

double measure_chase_rate(Context& context, std::size_t bytes) {
  using Line = std::array<std::uint32_t, 16>;
  const std::size_t lines = std::bit_floor(std::max<std::size_t>(1, bytes / sizeof(Line)));
  // A full cycle: a linear congruence with an odd term and a factor of 1 modulo 4.
  std::vector<Line> next(lines);
  for (std::size_t i = 0; i < lines; ++i)
    next[i][0] = static_cast<std::uint32_t>((i * 1664525u + 1013904223u) & (lines - 1));
  Kernel kernel = context.kernel(kProgram, "chased_lines");
  Buffer<Line> table(context, lines, "chased lines");
  Buffer<std::uint32_t> out(context, chain_items(context.device()), "ends of chases");
  table.upload(next);
  context.take_launches();
  return round_rate(context, [&](std::uint32_t rounds) {
    kernel.launch(chain_range(context.device()), table, out, rounds,
                  static_cast<std::uint32_t>(lines - 1));
  });
}

double measure_tile_rate(Context& context, std::size_t bytes) {
  // Planes that the loss reads of a channel, lines of a row of 800 pixels and its borders.
  constexpr std::size_t kPlanes = 5, kStride = 52, kTileRows = 4;
  constexpr std::size_t kLines = std::size_t{1} << 20;  // that a launch reads, at least
  const std::size_t rows =
      std::max<std::size_t>(1, bytes / sizeof(Float16) / (kPlanes * kStride * kTileRows));
  const std::size_t lines = kPlanes * kStride * kTileRows * rows;
  const auto passes = static_cast<std::uint32_t>((kLines + lines - 1) / lines);
  Kernel kernel = context.kernel(kProgram, "tiled_lines");
  Buffer<Float16> table(context, lines, "planes of pictures");
  Buffer<Float16> out(context, rows, "sums of tiles");
  table.clear();
  context.take_launches();
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < kCopies; ++i) {
    const ProcessorTime processors(context);
    kernel.launch(Range::linear(rows, 1), table, out, static_cast<std::uint32_t>(kPlanes),
                  static_cast<std::uint32_t>(kStride), passes);
    const double spent = launch_seconds(context);
    best = std::min(best, spent * processors.share(spent));
  }
  return static_cast<double>(passes * lines) / best;
}

// How late the other processors begin: what a launch takes longer than kSeconds, which all at once
// would take, is what the others miss, shared among all.
double measure_late_seconds(Context& context) {
  constexpr double kSeconds = 2e-4;
  const double units = std::max<double>(1, context.device().compute_units);
  Kernel kernel = context.kernel(kProgram, "vector_steps");
  const std::size_t items = chain_items(context.device());
  Buffer<Float16> out(context, items, "sums of steps");
  const double rounds =
      kSeconds * measure_vector_rate(context) / (kChainSteps * static_cast<double>(items));
  double best = std::numeric_limits<double>::infinity();
  for (int i = 0; i < 10 * kRepetitions; ++i) {
    const ProcessorTime processors(context);
    kernel.launch(chain_range(context.device()), out, static_cast<std::uint32_t>(rounds), 0.999f,
                  0.001f);
    const double spent = launch_seconds(context);
    best = std::min(best, spent * processors.share(spent));
  }
  return units > 1 ? std::max(0.0, best - kSeconds) * units / (units - 1) : 0.0;
}

double measure_store_rate(Context& context, std::size_t bytes) {
  const std::size_t words = std::bit_floor(std::max<std::size_t>(1, bytes / sizeof(std::uint64_t)));
  Kernel kernel = context.kernel(kProgram, "random_stores");
  Buffer<std::uint64_t> table(context, words, "random words");
  table.clear();
  context.take_launches();
  return round_rate(context, [&](std::uint32_t rounds) {
    kernel.launch(chain_range(context.device()), table, rounds,
                  static_cast<std::uint32_t>(words - 1));
  });
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
  const auto take = [&](const auto& launch) {
    const ProcessorTime processors(context);
    launch();
    const double spent = launch_seconds(context);
    best = std::min(best, spent * processors.share(spent));
  };
  for (int i = 0; i < kCopies; ++i) {
    take([&] { by_runs.launch(Range::linear(runs, 1), in, out, static_cast<std::uint32_t>(run)); });
    take([&] { by_stride.launch(stride, in, out); });
    take([&] { in_place.launch(Range::linear(runs, 1), out, static_cast<std::uint32_t>(run)); });
  }
  return 2.0 * sizeof(Float4) * static_cast<double>(elements) / best;
}

}  // namespace raysplats
