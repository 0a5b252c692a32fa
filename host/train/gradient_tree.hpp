// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "comm/communicator.hpp"
#include "comm/pairwise.hpp"
#include "device/context.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// What the views of a step say together: the gradient of every parameter of the Gaussians, and of
/// a sky where there is one.
struct StepGradients {
  GaussianGradients gaussians;
  Buffer<float> sky;  ///< empty without one
};

/// Sum of the gradients of a step's views in the tree of PairwiseNode over their slots: neighbours
/// first, then neighbouring sums, ((0 + 1) + (2 + 3)) + ((4 + 5) + 6) for seven. So the sum is a
/// function of the slots alone, whoever finds their gradients and when; what is kept at once is a
/// set for every level. GaussianGradients::screen is added too: what density control counts, and
/// how many views met a Gaussian.
class GradientTree {
 public:
  explicit GradientTree(Context& context) : context_(context) {}

  /// Forgets what was added: a step that broke off.
  void clear();
  /// Takes the gradients of a slot, which follows the last one since finish() or clear(), and
  /// leaves buffers of an earlier one in their place. Enqueues without waiting.
  void add(std::size_t slot, StepGradients& gradients);
  /// Moves the sum of all slots to `sum`. Throws UsageError without any.
  void finish(StepGradients& sum);
  /// All ranks: the same for `slots` slots, of which each rank has added those of its RankShare.
  /// With several ranks the sums go through the host, and are waited for.
  void finish(StepGradients& sum, Communicator& ranks, std::size_t slots);

 private:
  void join(StepGradients& left, StepGradients& right);

  Context& context_;
  PairwiseSum<StepGradients> sum_;
  std::vector<StepGradients> spare_;  // buffers of sets that have been added
  // On the host, with several ranks: the numbers of every part, and their sum.
  std::vector<std::vector<float>> rows_;
  std::vector<float> total_, room_;
};

}  // namespace raysplats
