// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "bench/bench.hpp"
#include "bench/executed_work.hpp"
#include "bench/operation.hpp"
#include "device/context.hpp"

namespace raysplats {

/// Every operation on one model seen by one camera. Construction does not touch the device: what an
/// operation needs is made when it is prepared, and kept.
class SceneBench {
 public:
  /// `model` and `options` have to outlive it.
  SceneBench(Context& context, const BenchModel& model, const BenchOptions& options);
  SceneBench(Context& context, const BenchModel&& model, const BenchOptions& options) = delete;
  ~SceneBench();

  /// They refer to this object.
  std::vector<BenchOperation> operations();
  /// What kernels of either form do on this view and through the same arbitrary rays, counted by
  /// the kernels themselves; waits for the device. Rays of groups need a device that runs their
  /// kernels.
  ExecutedCounts counts(bool grouped);

  struct Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
