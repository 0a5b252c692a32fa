// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "bvh/lbvh_validate.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/ray_tree.hpp"

namespace raysplats {

/// The tree over Gaussians read back from the device, with the boxes it is over and its blocks.
struct RayTreeCopy {
  LbvhCopy tree;
  std::vector<RsAabb> boxes;
  std::vector<float> blocks;
  TraceOptions options;

  static RayTreeCopy of(const RayTree& tree);
  /// Place in `blocks` of the index (as bits) and of coordinate `axis` of the mean in a slot.
  std::size_t index_at(std::size_t slot) const;
  std::size_t mean_at(std::size_t slot, std::size_t axis) const;

 private:
  std::size_t at(std::size_t slot, std::size_t k) const;
};

/// Checks the tree of the last build() or refit() against the model that it was made of: every
/// confidence ellipsoid (in double precision) lies in its Gaussian's box, validate_lbvh(), and
/// every slot of a block holds the Gaussian that the order says. Returns "" or one sentence about
/// the first fault.
std::string validate_ray_tree(const RayTreeCopy& tree,
                              const Gaussians& model,
                              LeafOrder order = LeafOrder::kCurve);

}  // namespace raysplats
