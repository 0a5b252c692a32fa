// SPDX-License-Identifier: Apache-2.0
#include "bench/speed_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr double kLineBytes = 64;
constexpr double kWave = 32;  // work-items of a wave that counts are given for

double per_second(const std::vector<DeviceSpeeds::Level>& levels, double bytes) {
  for (const DeviceSpeeds::Level& level : levels)
    if (bytes <= level.bytes) return level.per_second;
  return levels.empty() ? 0.0 : levels.back().per_second;
}

double over(double amount, double rate) { return rate > 0 ? amount / rate : 0.0; }

double arithmetic_seconds(const KernelWork& work, const DeviceSpeeds& device) {
  const double vectors = over(work.vectors, device.vectors);
  const double scalars = over(work.scalars, device.scalars > 0 ? device.scalars : device.vectors);
  const double slow = over(work.slow, device.slow);
  if (device.cpu) {
    return vectors + scalars + slow + over(work.shifted, device.shifted) +
           over(work.parked, device.parked);
  }
  return std::max(device.scalars > 0 ? std::max(vectors, scalars) : vectors + scalars, slow);
}

double memory_seconds(const KernelWork& work, const DeviceSpeeds& device) {
  const double streamed = over(work.bytes, per_second(device.bandwidth, work.footprint));
  if (!device.lines.empty()) return streamed;
  return streamed +
         over(kLineBytes * (work.lines + work.runs), per_second(device.bandwidth, work.table));
}

// What neither caches nor prefetching foresee, where that is known.
double random_seconds(const KernelWork& work, const DeviceSpeeds& device) {
  if (device.lines.empty()) return 0;
  return over(work.lines, per_second(device.lines, work.table)) +
         over(work.runs, per_second(device.runs, work.table)) +
         over(work.chases, per_second(device.chases, work.path)) +
         over(work.tiled, per_second(device.tiled, work.footprint)) +
         over(work.stores, per_second(device.stores, work.targets));
}

// More than if all processors took part from the beginning, of launches that take `seconds` then:
// what they miss, shared among all, but no more than all of their part.
double late_seconds(const KernelWork& work, const DeviceSpeeds& device, double seconds) {
  const double others = device.processors - 1;
  return std::min(others * seconds, work.shared * device.late_seconds * others / device.processors);
}

// Of all waves one after the other.
double serial_cycles(const KernelWork& work, const DeviceSpeeds& device) {
  return (work.vectors + work.scalars + work.slow) * device.issue_cycles +
         work.trips * device.trip_cycles + (work.local + work.barriers) * device.local_cycles;
}

// Of the highest clocks that the makers state. Caches: sizes as the makers state them, rates as
// others measured them.
std::vector<Card> make_cards() {
  constexpr double kGiga = 1e9, kMega = 1024.0 * 1024.0;
  std::vector<Card> out(4);
  Card& amd = out[0];
  amd.speeds = {.name = "RX 7900 XTX",
                .vectors = 96 * 2 * 2.5 * kGiga,  // 96 units of two SIMD32
                .scalars = 96 * 2 * 2.5 * kGiga,
                .slow = 96 * 2 * 2.5 * kGiga / 4,
                .bandwidth = {{96 * kMega, 3500 * kGiga}, {INFINITY, 960 * kGiga}},
                .lines = {},
                .runs = {},
                .chases = {},
                .tiled = {},
                .stores = {},
                .local = 96 * 2.5 * kGiga,
                .atomics = 64 * 2.5 * kGiga,
                .clock = 2.5 * kGiga,
                .issue_cycles = 5,
                .trip_cycles = 300,
                .local_cycles = 30,
                .launch_seconds = 5e-6};
  amd.target = "gfx1100";
  amd.units = 192;  // SIMDs
  amd.registers = 1536;
  amd.most = 16;
  amd.local = 32 * 1024;  // of 128 kB that four SIMDs share
  amd.granule = 24;
  Card& intel = out[1];
  intel.speeds = {.name = "Arc A770",
                  .vectors = 512 * 8 / kWave * 2.1 * kGiga,  // 512 engines of 8 lanes
                  .slow = 512 * 8 / kWave * 2.1 * kGiga / 4,
                  .bandwidth = {{16 * kMega, 2000 * kGiga}, {INFINITY, 560 * kGiga}},
                  .lines = {},
                  .runs = {},
                  .chases = {},
                  .tiled = {},
                  .stores = {},
                  .local = 32 * 2.1 * kGiga,
                  .atomics = 32 * 2.1 * kGiga,
                  .clock = 2.1 * kGiga,
                  .issue_cycles = 10,
                  .trip_cycles = 500,
                  .local_cycles = 60,
                  .launch_seconds = 10e-6};
  intel.target = "dg2-g10";
  intel.units = 32;                // Xe cores
  intel.registers = 128 * 16 * 8;  // 128 in each of 8 threads of 16 engines
  intel.most = 128;
  intel.local = 128 * 1024;
  Card& ada = out[2];
  ada.speeds = {.name = "RTX 4090",
                .vectors = 128 * 4 * 2.52 * kGiga,  // 128 multiprocessors
                .slow = 128 * 0.5 * 2.52 * kGiga,
                .bandwidth = {{72 * kMega, 5000 * kGiga}, {INFINITY, 1008 * kGiga}},
                .lines = {},
                .runs = {},
                .chases = {},
                .tiled = {},
                .stores = {},
                .local = 128 * 2.52 * kGiga,
                .atomics = 64 * 2.52 * kGiga,
                .clock = 2.52 * kGiga,
                .issue_cycles = 4,
                .trip_cycles = 300,
                .local_cycles = 25,
                .launch_seconds = 5e-6};
  ada.target = "sm_86";  // of compilers at hand; the same registers, local memory and waves
  ada.units = 128;
  ada.registers = 2048;
  ada.most = 48;
  ada.local = 100 * 1024;
  ada.granule = 8;
  Card& hopper = out[3];
  hopper.speeds = {.name = "H200",
                   .vectors = 132 * 4 * 1.98 * kGiga,
                   .slow = 132 * 0.5 * 1.98 * kGiga,
                   .bandwidth = {{50 * kMega, 5500 * kGiga}, {INFINITY, 4800 * kGiga}},
                   .lines = {},
                   .runs = {},
                   .chases = {},
                   .tiled = {},
                   .stores = {},
                   .local = 132 * 1.98 * kGiga,
                   .atomics = 64 * 1.98 * kGiga,
                   .clock = 1.98 * kGiga,
                   .issue_cycles = 4,
                   .trip_cycles = 280,
                   .local_cycles = 25,
                   .launch_seconds = 5e-6};
  hopper.target = "sm_90";
  hopper.units = 132;
  hopper.registers = 2048;
  hopper.most = 64;
  hopper.local = 227 * 1024;
  hopper.granule = 8;
  return out;
}

struct Row {
  const char* row;
  const char* kernel;  // that takes most of it
};
constexpr Row kRows[] = {{"sort", "sort pairs: scatter"},
                         {"prepare-view", "prepare sh0: prepare_view"},
                         {"tile-lists", "lists: fill_tiles"},
                         {"forward", "group forward render: trace_forward_group"},
                         {"forward-train", "group forward train: trace_forward_group"},
                         {"backward", "group backward atomic: trace_backward_group"},
                         {"finalize", "finalize group sh3: finalize_group"},
                         {"loss-value", "loss group: group_slopes"},
                         {"loss-gradient", "loss group: group_gradient"},
                         {"adam", "adam sh3: adam_step"},
                         {"rays", "rays: trace_rays"}};

}  // namespace

KernelWork KernelWork::operator+(const KernelWork& other) const {
  KernelWork out = *this;
  out.vectors += other.vectors;
  out.scalars += other.scalars;
  out.slow += other.slow;
  out.shifted += other.shifted;
  out.parked += other.parked;
  out.bytes += other.bytes;
  out.footprint = std::max(footprint, other.footprint);
  out.lines += other.lines;
  out.runs += other.runs;
  out.chases += other.chases;
  out.path = std::max(path, other.path);
  out.tiled += other.tiled;
  out.stores += other.stores;
  out.targets = std::max(targets, other.targets);
  out.table = std::max(table, other.table);
  out.local += other.local;
  out.atomics += other.atomics;
  out.trips += other.trips;
  out.barriers += other.barriers;
  out.launches += other.launches;
  out.shared += other.shared;
  return out;
}

Prediction predict(const KernelWork& work, const DeviceSpeeds& device, double resident) {
  const std::vector<Prediction> limits{
      {arithmetic_seconds(work, device), "arithmetic"},
      {memory_seconds(work, device), "memory"},
      {over(work.local, device.local), "local memory"},
      {over(work.atomics, device.atomics), "atomics"},
      {resident > 0 ? over(serial_cycles(work, device), device.clock * resident) : 0.0, "latency"}};
  Prediction out = *std::max_element(
      limits.begin(), limits.end(),
      [](const Prediction& a, const Prediction& b) { return a.seconds < b.seconds; });
  const double random = random_seconds(work, device);
  if (random > out.seconds) out.bound = "memory";
  out.seconds += random;
  const double launches =
      work.launches * device.launch_seconds + late_seconds(work, device, out.seconds);
  if (launches > out.seconds) out.bound = "launches";
  out.seconds += launches;
  return out;
}

const std::vector<Card>& cards() {
  static const std::vector<Card> all = make_cards();
  return all;
}

const CompiledKernel& compiled_kernel(const std::string& row, const std::string& target) {
  for (const Row& one : kRows) {
    if (row != one.row) continue;
    for (const CompiledKernel& kernel : compiled_kernels())
      if (kernel.name == one.kernel && kernel.target == target) return kernel;
  }
  throw UsageError(fmt::format("There is no compiled kernel of row '{}' for {}", row, target));
}

double resident_waves(const Card& card, const CompiledKernel& kernel) {
  const double waves_of_group = std::max(1.0, kernel.group / kernel.width);
  const double registers = std::ceil(kernel.registers / card.granule) * card.granule;
  double waves = std::min(card.most, std::floor(card.registers / registers));
  if (kernel.local > 0)
    waves = std::min(waves, std::floor(card.local / kernel.local * waves_of_group));
  return std::max(waves, 1.0) * card.units * kernel.width / kWave;
}

}  // namespace raysplats
