// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "bvh/wide_tree.hpp"
#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/layout.h"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Tree over Gaussians for rays without coherence: a WideTree with the Gaussians themselves, ready
/// to be traced, in its leaf blocks (cl/trace/ray_block.h).
class RayTree {
 public:
  RayTree(Context& context, const TraceOptions& options, int lanes);

  void build(const DeviceGaussians& gaussians);
  /// For Gaussians that changed but kept their number since build(). Throws UsageError otherwise.
  void refit(const DeviceGaussians& gaussians);

  const WideTree& tree() const { return tree_; }
  const Buffer<float>& blocks() const { return blocks_; }

 private:
  void compute_boxes(const DeviceGaussians& gaussians);
  void fill(const DeviceGaussians& gaussians);

  Context* context_;
  TraceOptions options_;
  WideTree tree_;
  Buffer<RsAabb> boxes_;
  Buffer<float> blocks_;
};

}  // namespace raysplats
