// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>

#include "raysplats/trainer.hpp"
#include "run/run_folder.hpp"

namespace raysplats {

/// A run between two of its steps, when the device has done all it was given.
struct RunMoment {
  std::int64_t iteration = 0;         ///< completed
  std::array<float, 3> background{};  ///< behind test views
  SkyLight sky{};                     ///< in its place, as far as it is trained; empty without one
  const DeviceGaussians* model = nullptr;  ///< as it would be saved
};

/// What a watcher asks for after a look.
struct RunWish {
  bool wait = false;  ///< to look again before the next step
  bool save = false;  ///< the model and a checkpoint
};

/// Looks at a run from within its loop, in its thread. The run is the same with and without: a
/// watcher may trace the model with tracers of its own, and changes nothing.
class RunWatcher {
 public:
  virtual ~RunWatcher() = default;

  /// Hears of every row of metrics.csv and of every evaluation.
  virtual void noted(const TrainRow& row) = 0;
  virtual void evaluated(const EvaluationRow& row) = 0;
  /// Hears that the run will end with another iteration than it was planned to.
  virtual void will_end(std::int64_t iteration) = 0;
  /// Asked after every step, which the device may still be busy with: has to be quick. Nothing is
  /// waited for unless it says yes.
  virtual bool wants_look() = 0;
  /// `stopping` says whether the run has been told to end, which ends a wish to wait as well. The
  /// time that it takes counts neither as training nor as evaluation.
  virtual RunWish look(const RunMoment& moment, const std::function<bool()>& stopping) = 0;
};

}  // namespace raysplats
