// SPDX-License-Identifier: Apache-2.0
#include "bench/speed_model.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr double kLineBytes = 64;

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

// Cycles of all waves one after the other.
double serial_cycles(const KernelWork& work, const DeviceSpeeds& device) {
  return (work.vectors + work.scalars + work.slow) * device.issue_cycles +
         work.trips * device.trip_cycles + (work.local + work.barriers) * device.local_cycles;
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
                         {"loss-value", "loss group: group_ssim_derivatives"},
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

const CompiledKernel& compiled_kernel(const std::string& row, const std::string& target) {
  for (const Row& one : kRows) {
    if (row != one.row) continue;
    for (const CompiledKernel& kernel : compiled_kernels())
      if (kernel.name == one.kernel && kernel.target == target) return kernel;
  }
  throw UsageError(fmt::format("There is no compiled kernel of row '{}' for {}", row, target));
}

}  // namespace raysplats
