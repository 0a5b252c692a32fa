// SPDX-License-Identifier: Apache-2.0
#include "train/memory_estimate.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "shared/layout.h"

namespace raysplats {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;

}  // namespace

MemoryEstimate estimate_memory(const TrainOptions& options,
                               std::size_t max_gaussians,
                               std::size_t pixels,
                               std::size_t views) {
  const auto sh = static_cast<std::size_t>(3 * sh_coefficients(options.sh_degree));
  const std::size_t floats = 3 + 4 + 3 + 1 + sh;
  MemoryEstimate out;
  // Parameters, gradients and two moments; while the set changes, one more copy of the moments or
  // the parameters.
  out.gaussians = max_gaussians * (floats * 4 + sh * 2 + 5) * sizeof(float);
  // Line, gradient line, bounds, box, candidate keys and values with their second copies.
  out.tracing = max_gaussians * (2 * sizeof(RsLine) + sizeof(RsViewBounds) + sizeof(RsAabb) + 44);
  // Image, gradient, depth and about 12 planes of the loss.
  out.images = std::min(static_cast<std::size_t>(options.image_budget) * kMiB, views * pixels * 4) +
               pixels * 24 * sizeof(float);
  out.hits = std::min(static_cast<std::size_t>(options.memory_budget) * kMiB,
                      pixels * static_cast<std::size_t>(options.max_hits) * 12);
  out.largest_buffer = std::max(max_gaussians * sh * sizeof(float), max_gaussians * sizeof(RsLine));
  return out;
}

void check_memory(const MemoryEstimate& estimate, const DeviceInfo& device) {
  const auto mib = [](std::size_t bytes) {
    return static_cast<double>(bytes) / static_cast<double>(kMiB);
  };
  if (estimate.total() > device.global_memory) {
    throw ResourceError(fmt::format(
        "Training needs about {:.0f} MiB ({:.0f} for Gaussians, {:.0f} for tracing, {:.0f} for "
        "images, {:.0f} for "
        "hits) but {} has {:.0f} MiB: lower --max-gaussians, --sh-degree or --memory-budget, or "
        "raise --downscale",
        mib(estimate.total()), mib(estimate.gaussians), mib(estimate.tracing), mib(estimate.images),
        mib(estimate.hits), device.name, mib(device.global_memory)));
  }
  if (estimate.largest_buffer > device.max_allocation) {
    throw ResourceError(
        fmt::format("The largest buffer of this run needs {:.0f} MiB but {} allows {:.0f} MiB at "
                    "once: lower --max-gaussians or "
                    "--sh-degree",
                    mib(estimate.largest_buffer), device.name, mib(device.max_allocation)));
  }
}

}  // namespace raysplats
