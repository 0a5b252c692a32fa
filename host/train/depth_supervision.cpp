// SPDX-License-Identifier: Apache-2.0
#include "train/depth_supervision.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdint>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

DepthSupervision::DepthSupervision(Context& context,
                                   const Dataset& dataset,
                                   std::span<const std::size_t> views,
                                   double weight,
                                   double unit)
    : context_(context),
      weight_(weight),
      slopes_(context.kernel("train/depth_supervision.cl", "depth_slopes")),
      targets_(views.size()) {
  std::size_t with_maps = 0, with_points = 0;
  for (const std::size_t index : views) {
    const View& view = dataset.views[index];
    maps_.push_back(io::view_depths(dataset, view, unit));
    if (maps_.back().values.empty()) continue;
    ++(view.depth_path.empty() ? with_points : with_maps);
  }
  if (with_maps + with_points == 0) {
    throw UsageError(
        fmt::format("The data set {} has neither depth maps nor sparse points with the photos that "
                    "show them: leave out 'depth-weight'",
                    dataset.root.string()));
  }
  spdlog::info("depth is known of {} training views from maps and of {} from sparse points",
               with_maps, with_points);
}

// Uploads wait for the device, once for each size of a view.
const DepthSupervision::Target& DepthSupervision::target(std::size_t view, int width, int height) {
  Target& out = targets_[view];
  if (out.width == width && out.height == height) return out;
  const io::DepthMap map = io::reduced(maps_[view], width, height);
  out.width = width;
  out.height = height;
  out.known = static_cast<float>(
      std::count_if(map.values.begin(), map.values.end(), [](float d) { return d > 0; }));
  if (out.known == 0) return out;
  out.depths = Buffer<float>(context_, map.values.size(), "known depths");
  out.depths.upload(map.values);
  return out;
}

void DepthSupervision::backward(std::size_t view,
                                int width,
                                int height,
                                const Buffer<float>& image,
                                const Buffer<float>& depth,
                                const DevicePhoto& photo,
                                Buffer<float>& image_gradient) {
  const std::size_t pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const Target& known = target(view, width, height);
  if (gradient_.size() < pixels) gradient_ = Buffer<float>(context_, pixels, "depth gradient");
  if (known.known == 0) {
    gradient_.clear();
    return;
  }
  slopes_.launch(Range::linear(pixels, kGroup), image, depth, known.depths, photo.words,
                 image_gradient, gradient_, static_cast<std::uint32_t>(pixels), photo.planes,
                 photo.weighted ? 1 : 0, static_cast<float>(weight_) / known.known);
}

}  // namespace raysplats
