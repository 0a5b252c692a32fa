// SPDX-License-Identifier: Apache-2.0
#include "bvh/gaussian_bounds.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
constexpr std::size_t kCpuChunk = 1024;
constexpr std::size_t kMaxCount = std::size_t{1} << 31;

}  // namespace

GaussianBounds::GaussianBounds(Context& context, bool sigmoid_scale, bool adaptive_radius)
    : context_(&context),
      chunk_(context.device().type == DeviceType::kCpu ? kCpuChunk : 1),
      kernel_(context.kernel("bvh/gaussian_bounds.cl",
                             "gaussian_bounds",
                             BuildOptions()
                                 .define("SIGMOID_SCALE", sigmoid_scale ? 1 : 0)
                                 .define("ADAPTIVE_RADIUS", adaptive_radius ? 1 : 0))) {}

void GaussianBounds::compute(const Buffer<float>& means,
                             const Buffer<float>& quaternions,
                             const Buffer<float>& scales,
                             const Buffer<float>& opacities,
                             std::size_t count,
                             float quantile,
                             Buffer<RsAabb>& boxes) {
  if (count >= kMaxCount || means.size() < 3 * count || quaternions.size() < 4 * count ||
      scales.size() < 3 * count || opacities.size() < count) {
    throw UsageError(
        fmt::format("Bounds of {} Gaussians need buffers of as many and at most 2^31", count));
  }
  boxes.ensure(*context_, count, "Gaussian bounds");
  const std::size_t items = (count + chunk_ - 1) / chunk_;
  kernel_.launch(Range::linear(items, chunk_ > 1 ? 1 : kGroup), means, quaternions, scales,
                 opacities, BufferAs<float>{boxes.raw()}, quantile,
                 static_cast<std::uint32_t>(count), static_cast<std::uint32_t>(chunk_));
}

}  // namespace raysplats
