// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bvh/lbvh.hpp"
#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/layout.h"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Whether rays may be cones, for which leaf blocks have axes and scales.
inline bool has_cones(const TraceOptions& options) { return options.view_footprint > 0; }

/// The tree over Gaussians that rays walk: an Lbvh with the Gaussians themselves, ready to be
/// traced, in its leaf blocks (cl/trace/ray_block.h).
class RayTree {
 public:
  RayTree(Context& context, const TraceOptions& options, const TreeForm& form);

  /// Floats that a Gaussian has in its leaf block.
  static std::size_t block_floats(const TraceOptions& options, const TreeForm& form);
  /// Whether a Gaussian's squared radius is among them.
  static bool has_quantiles(const TraceOptions& options, const TreeForm& form) {
    return options.adaptive_radius || form.trail;
  }

  void build(const DeviceGaussians& gaussians);
  /// Follows Gaussians that changed but kept their number since build(). Throws UsageError
  /// otherwise, and where build() did not come to its end.
  void refit(const DeviceGaussians& gaussians);
  /// Follows Gaussians that changed in any way: refit(), and build() where their number changed,
  /// all of them left the place of the last build(), the cost of walking the refitted tree has
  /// grown by more than kGrowth since, or that build() failed. Returns true after a build(). Waits
  /// for the device.
  bool follow(const DeviceGaussians& gaussians);

  /// Growth of the cost at which a build pays. Rays take longer in proportion.
  static constexpr double kGrowth = 1.1;

  const Lbvh& tree() const { return tree_; }
  auto arguments() const { return tree_.arguments(blocks_); }
  const Buffer<float>& blocks() const { return blocks_; }
  /// Boxes of the Gaussians, by their numbers.
  const Buffer<RsAabb>& boxes() const { return boxes_; }
  const TraceOptions& options() const { return options_; }

 private:
  void compute_boxes(const DeviceGaussians& gaussians);
  void fill(const DeviceGaussians& gaussians);

  Context* context_;
  TraceOptions options_;
  Lbvh tree_;
  Buffer<RsAabb> boxes_;
  Buffer<float> blocks_;
  bool built_ = false;      // the last build() came to its end
  double built_cost_ = -1;  // right after build(), once follow() has asked for it
};

}  // namespace raysplats
