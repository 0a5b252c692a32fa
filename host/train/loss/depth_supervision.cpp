// SPDX-License-Identifier: Apache-2.0
#include "train/loss/depth_supervision.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdint>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "train/depth_supervision.cl";
constexpr std::size_t kGroup = 64;

}  // namespace

DepthSupervision::DepthSupervision(Context& context,
                                   const Dataset& dataset,
                                   std::span<const std::size_t> views,
                                   double weight,
                                   double unit,
                                   std::size_t budget)
    : context_(context),
      weight_(weight),
      add_gradient_(context.kernel(kProgram, "add_depth_gradient")),
      add_listed_gradient_(context.kernel(kProgram, "add_listed_depth_gradient")),
      cache_(context, dataset, views, unit, budget) {
  if (cache_.with_maps() + cache_.with_points() == 0) {
    throw UsageError(
        fmt::format("The data set {} has neither depth maps nor sparse points with the photos that "
                    "show them: leave out 'depth-weight'",
                    dataset.root.string()));
  }
  spdlog::info("depth is known of {} training views from maps and of {} from sparse points",
               cache_.with_maps(), cache_.with_points());
  const std::size_t bytes = depth_map_bytes(dataset, views);
  if (bytes > budget) {
    spdlog::info(
        "the depth maps take {:.0f} MiB, and their part of 'image-budget' is {:.0f}: those that "
        "find no room are read again for every step that shows them",
        mib(bytes), mib(budget));
  }
}

void DepthSupervision::backward(const SizedView& view,
                                const Buffer<float>& image,
                                const Buffer<float>& depth,
                                const DevicePhoto& photo,
                                Buffer<float>& image_gradient) {
  const std::size_t pixels = pixel_count(view.width, view.height);
  const DeviceDepths& target = cache_.get(view);
  if (gradient_.size() < pixels) gradient_ = Buffer<float>(context_, pixels, "depth gradient");
  if (target.known == 0 || target.listed) gradient_.clear(pixels);
  if (target.known == 0) return;
  const std::int32_t weighted = photo.weighted ? 1 : 0;
  const float scale = static_cast<float>(weight_) / static_cast<float>(target.known);
  if (target.listed) {
    add_listed_gradient_.launch(Range::linear(target.known, kGroup), image, depth, target.pixels,
                                target.depths, photo.words, image_gradient, gradient_,
                                static_cast<std::uint32_t>(target.known),
                                static_cast<std::uint32_t>(pixels), photo.planes, weighted, scale);
    return;
  }
  add_gradient_.launch(Range::linear(pixels, kGroup), image, depth, target.depths, photo.words,
                       image_gradient, gradient_, static_cast<std::uint32_t>(pixels), photo.planes,
                       weighted, scale);
}

}  // namespace raysplats
