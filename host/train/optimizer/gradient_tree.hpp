// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "comm/communicator.hpp"
#include "comm/pairwise.hpp"
#include "comm/slot_sum.hpp"
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

  /// All ranks: a sum of `slots` slots, of which each rank adds those of its RankShare, over the
  /// parameters of `gaussians`. Forgets what was added: a step that broke off, after wait().
  void begin(Communicator& ranks, std::size_t slots, const DeviceGaussians& gaussians);
  /// Takes the gradients of a slot, which follows the last one since begin(), and leaves buffers of
  /// an earlier one in their place. Enqueues without waiting; what is whole for other ranks goes to
  /// them while the device goes on (SlotSum).
  void add(std::size_t slot, StepGradients& gradients);
  /// All ranks: waits until all slots have been added and told.
  void wait();
  /// All ranks, after wait(): moves the sum of all slots to `sum`, which add() has left. With
  /// several ranks it comes from the host. Throws UsageError without any slot.
  void finish(StepGradients& sum);

 private:
  void join(StepGradients& left, StepGradients& right);
  void send();

  Context& context_;
  PairwiseSum<StepGradients> sum_;
  std::vector<StepGradients> spare_;  // buffers of sets that have been added
  std::size_t count_ = 0;             // of Gaussians
  int sh_degree_ = 0;
  // With several ranks.
  Communicator* ranks_ = nullptr;
  std::size_t slots_ = 0;
  std::vector<PairwiseNode> wanted_;                       // that this one sends
  std::vector<std::shared_ptr<std::vector<float>>> rows_;  // their numbers, on the host
  std::size_t sent_ = 0;                                   // of them
  std::vector<float> total_;
  SlotSum among_;  // ends before what it reads
};

}  // namespace raysplats
