// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tree_validate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "scene/gaussians/activation.hpp"
#include "shared/tree_layout.h"

namespace raysplats {
namespace {

// Alphas about which the device may disagree whether any ray meets the Gaussian.
constexpr double kMargin = 1.001;

bool is_empty(const RsAabb& box) { return box.lo[0] > box.hi[0]; }

// Half-widths of the confidence ellipsoid; false where no ray need meet the Gaussian.
bool half_widths(const Gaussians& model,
                 std::size_t i,
                 const TraceOptions& options,
                 std::array<double, 3>& out) {
  const auto number = [](float value) { return static_cast<double>(value); };
  const glm::dquat raw(number(model.quaternions[4 * i]), number(model.quaternions[4 * i + 1]),
                       number(model.quaternions[4 * i + 2]), number(model.quaternions[4 * i + 3]));
  if (!(glm::length(raw) > 0)) return false;
  const glm::dmat3 rotation = glm::mat3_cast(glm::normalize(raw));
  const double alpha = sigmoid(number(model.opacities[i]));
  double quantile = number(options.quantile);
  if (options.adaptive_radius) quantile = std::min(quantile, 2 * std::log(255 * alpha));
  if (!(quantile > 0) || (options.adaptive_radius && alpha * 255 < kMargin)) return false;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double variance = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double part = rotation[static_cast<int>(k)][static_cast<int>(axis)] *
                          std::exp(number(model.log_scales[3 * i + k]));
      variance += part * part;
    }
    out[axis] = std::sqrt(quantile * variance);
    const double mean = number(model.means[3 * i + axis]);
    if (!std::isfinite(static_cast<float>(kMargin * (std::abs(mean) + out[axis])))) return false;
  }
  return true;
}

std::string check_boxes(const RayTreeCopy& tree, const Gaussians& model) {
  for (std::size_t i = 0; i < tree.boxes.size(); ++i) {
    const RsAabb& box = tree.boxes[i];
    std::array<double, 3> half{};
    if (!half_widths(model, i, tree.options, half)) continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto mean = static_cast<double>(model.means[3 * i + axis]);
      const auto lo = static_cast<double>(box.lo[axis]), hi = static_cast<double>(box.hi[axis]);
      if (lo <= mean - half[axis] && mean + half[axis] <= hi) continue;
      return fmt::format(
          "the box of Gaussian {} from {} to {} does not hold its ellipsoid from {} to {} on axis "
          "{}",
          i, box.lo[axis], box.hi[axis], mean - half[axis], mean + half[axis], axis);
    }
  }
  return "";
}

std::string check_blocks(const RayTreeCopy& tree, const Gaussians& model) {
  for (std::size_t slot = 0; slot < tree.tree.count; ++slot) {
    const std::uint32_t gaussian = tree.tree.slots[slot];
    const auto index = std::bit_cast<std::uint32_t>(tree.blocks[tree.index_at(slot)]);
    if (index != gaussian) {
      return fmt::format("slot {} holds Gaussian {} where the order has {}", slot, index, gaussian);
    }
    std::array<double, 3> half{};
    if (is_empty(tree.boxes[gaussian]) || !half_widths(model, gaussian, tree.options, half))
      continue;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float mean = tree.blocks[tree.mean_at(slot, axis)];
      if (mean == model.means[3 * gaussian + axis]) continue;
      return fmt::format("slot {} has {} for coordinate {} of Gaussian {} at {}", slot, mean, axis,
                         gaussian, model.means[3 * gaussian + axis]);
    }
  }
  return "";
}

}  // namespace

RayTreeCopy RayTreeCopy::of(const RayTree& tree) {
  RayTreeCopy out;
  out.tree = LbvhCopy::of(tree.tree());
  out.options = tree.options();
  out.boxes.resize(out.tree.count);
  if (out.tree.count == 0) return out;
  tree.boxes().download(std::span<RsAabb>(out.boxes));
  out.blocks = tree.blocks().download();
  return out;
}

std::size_t RayTreeCopy::index_at(std::size_t slot) const {
  if (has_cones(options)) return at(slot, RS_CONE_INDEX);
  return at(slot, RS_GAUSSIAN_INDEX(RayTree::has_quantiles(options, tree.form()) ? 1 : 0));
}

std::size_t RayTreeCopy::mean_at(std::size_t slot, std::size_t axis) const {
  return at(slot, (has_cones(options) ? RS_CONE_MEAN : RS_GAUSSIAN_MEAN) + axis);
}

std::size_t RayTreeCopy::at(std::size_t slot, std::size_t k) const {
  const std::size_t lanes = tree.lanes;
  const std::size_t vectors = RayTree::block_floats(options, tree.form());
  // RS_LANE_FLOAT of cl/bvh/lbvh_node.h.
  return tree.trail ? slot * vectors + k : (slot / lanes * vectors + k) * lanes + slot % lanes;
}

std::string validate_ray_tree(const RayTreeCopy& tree, const Gaussians& model, LeafOrder order) {
  if (tree.tree.count != model.size()) {
    return fmt::format("the tree is over {} Gaussians and the model has {}", tree.tree.count,
                       model.size());
  }
  if (std::string fault = check_boxes(tree, model); !fault.empty()) return fault;
  if (std::string fault = validate_lbvh(tree.tree, tree.boxes, order); !fault.empty()) return fault;
  return check_blocks(tree, model);
}

}  // namespace raysplats
