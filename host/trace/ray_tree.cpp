// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tree.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "bvh/gaussian_bounds.hpp"
#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "shared/tree_layout.h"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

std::size_t RayTree::block_floats(const TraceOptions& options, const TreeForm& form) {
  if (has_cones(options)) return RS_CONE_VECTORS;
  return RS_GAUSSIAN_VECTORS(has_quantiles(options, form) ? 1 : 0);
}

RayTree::RayTree(Context& context, const TraceOptions& options, const TreeForm& form)
    : context_(&context), options_(options), tree_(context, form) {}

void RayTree::build(const DeviceGaussians& gaussians) {
  built_ = false;
  if (gaussians.count > 0) compute_boxes(gaussians);
  tree_.order(boxes_, gaussians.count);
  blocks_.ensure(*context_,
                 tree_.block_count() * static_cast<std::size_t>(tree_.lanes()) *
                     block_floats(options_, tree_.form()),
                 "ray blocks");
  fill(gaussians);
  built_cost_ = -1;
  built_ = true;
}

void RayTree::refit(const DeviceGaussians& gaussians) {
  if (!built_ || gaussians.count != tree_.size()) {
    throw UsageError(fmt::format("A ray tree over {} Gaussians cannot be refitted to {}: build it",
                                 tree_.size(), gaussians.count));
  }
  if (gaussians.count > 0) compute_boxes(gaussians);
  fill(gaussians);
}

bool RayTree::follow(const DeviceGaussians& gaussians) {
  if (built_ && gaussians.count == tree_.size() && gaussians.count > 0) {
    if (built_cost_ < 0) built_cost_ = tree_.cost(boxes_);
    refit(gaussians);
    const double cost = tree_.cost(boxes_);
    // The cost is 0 where no Gaussian is left in the window of the last build().
    if (cost > 0 && cost <= kGrowth * built_cost_) return false;
  }
  build(gaussians);
  return true;
}

void RayTree::compute_boxes(const DeviceGaussians& gaussians) {
  GaussianBounds bounds(*context_, gaussians.activation == ScaleActivation::kSigmoid,
                        options_.adaptive_radius);
  bounds.compute(gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
                 gaussians.count, options_.quantile, boxes_);
}

void RayTree::fill(const DeviceGaussians& gaussians) {
  if (gaussians.count == 0) return;
  BuildOptions build = tree_build(tree_.form());
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0)
      .define("ADAPTIVE_RADIUS", options_.adaptive_radius ? 1 : 0)
      .define("CONES", has_cones(options_) ? 1 : 0);
  const std::size_t padded = tree_.padded_blocks();
  context_->kernel("trace/ray_tree.cl", "fill_blocks", build)
      .launch(Range::linear(padded, kGroup), u32(gaussians.count), u32(padded), tree_.slots(),
              boxes_, gaussians.arguments(), sh_coefficients(gaussians.sh_degree),
              options_.quantile, blocks_, tree_.nodes());
  tree_.merge();
}

}  // namespace raysplats
