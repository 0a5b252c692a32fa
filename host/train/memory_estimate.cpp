// SPDX-License-Identifier: Apache-2.0
#include "train/memory_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "shared/layout.h"
#include "trace/exact_sum.h"

namespace raysplats {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;

// Whether gradients may be added in long integers, which take 16 sums per Gaussian.
bool may_sum_exactly(const TrainOptions& options, const DeviceInfo& device) {
  switch (options.gradient_sum) {
    case GradientSum::kExact:
      return true;
    case GradientSum::kAtomic:
    case GradientSum::kCopies:  // where those do not fit their share of memory-budget
      return false;
    case GradientSum::kAuto:
      break;
  }
  return options.deterministic && device.type != DeviceType::kCpu;
}

double mib(std::size_t bytes) { return static_cast<double>(bytes) / static_cast<double>(kMiB); }

}  // namespace

MemoryEstimate estimate_memory(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device) {
  const auto sh = static_cast<std::size_t>(3 * sh_coefficients(options.sh_degree));
  const std::size_t floats = 3 + 4 + 3 + 1 + sh;
  const std::size_t exact =
      may_sum_exactly(options, device) ? 16 * RS_EXACT_WORDS * sizeof(std::uint32_t) : 0;
  MemoryEstimate out;
  // Parameters, gradients and two moments; while the set changes, one more copy of the moments or
  // the parameters.
  out.gaussians = demand.gaussians * (floats * 4 + sh * 2 + 5) * sizeof(float);
  // Line, gradient line and its exact sums, bounds, box, candidate keys and values with their
  // second copies.
  out.tracing =
      demand.gaussians * (2 * sizeof(RsLine) + exact + sizeof(RsViewBounds) + sizeof(RsAabb) + 44);
  // Image, gradient, depth and about 12 planes of the loss.
  out.images = std::min(static_cast<std::size_t>(options.image_budget) * kMiB,
                        demand.views * demand.pixels * 4) +
               demand.pixels * 24 * sizeof(float);
  out.hits = std::min(static_cast<std::size_t>(options.memory_budget) * kMiB,
                      demand.pixels * static_cast<std::size_t>(options.max_hits) * 12);
  out.largest_buffer = demand.gaussians * std::max({sh * sizeof(float), sizeof(RsLine), exact});
  return out;
}

bool fits(const MemoryEstimate& estimate, const DeviceInfo& device) {
  return estimate.total() <= device.global_memory / 10 * 9 &&
         estimate.largest_buffer <= device.max_allocation;
}

std::size_t gaussians_that_fit(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device) {
  MemoryDemand trial = demand;
  std::size_t low = 0, high = demand.gaussians;
  while (low < high) {
    trial.gaussians = high - (high - low) / 2;
    if (fits(estimate_memory(options, trial, device), device)) {
      low = trial.gaussians;
    } else {
      high = trial.gaussians - 1;
    }
  }
  return low;
}

void check_memory(const TrainOptions& options,
                  const MemoryDemand& demand,
                  const DeviceInfo& device) {
  const MemoryEstimate estimate = estimate_memory(options, demand, device);
  if (fits(estimate, device)) return;
  const std::size_t most = gaussians_that_fit(options, demand, device);
  const std::string remedy =
      most > 0 ? fmt::format(
                     "--max-gaussians {} would fit, more with a lower --sh-degree, "
                     "--memory-budget or --image-budget",
                     most)
               : "lower --memory-budget or --image-budget, or raise --downscale";
  throw ResourceError(fmt::format(
      "Training up to {} Gaussians needs about {:.0f} MiB ({:.0f} for Gaussians, {:.0f} for "
      "tracing, "
      "{:.0f} for images, {:.0f} for hits; {:.0f} in the largest buffer) but {} has {:.0f} MiB, of "
      "which a run may take nine tenths, and {:.0f} MiB in one buffer: {}",
      demand.gaussians, mib(estimate.total()), mib(estimate.gaussians), mib(estimate.tracing),
      mib(estimate.images), mib(estimate.hits), mib(estimate.largest_buffer), device.name,
      mib(device.global_memory), mib(device.max_allocation), remedy));
}

}  // namespace raysplats
