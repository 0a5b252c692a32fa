// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <vector>

#include "run/run_folder.hpp"

namespace raysplats::view {

/// What pages are told of a run, whenever they ask: its state and curves of at most 1024 points,
/// evenly thinned. From any thread.
class RunHistory {
 public:
  explicit RunHistory(std::int64_t iterations) : iterations_(iterations) {}

  void add(const TrainRow& row);
  void add(const EvaluationRow& row);
  void set_iterations(std::int64_t iterations);
  void set_state(bool paused, double share);
  /// The last word on the run; empty while it goes on.
  void finish(const std::string& text);

  /// {"iterations", "paused", "share", "ended", "rows": [[iteration, seconds, loss, PSNR,
  /// Gaussians], ...], "tests": [[iteration, PSNR], ...], "left": seconds or null}.
  std::string json() const;

 private:
  mutable std::mutex mutex_;
  std::int64_t iterations_;
  std::vector<TrainRow> rows_;  ///< every stride_-th
  TrainRow newest_;
  std::size_t seen_ = 0;
  std::size_t stride_ = 1;
  std::vector<EvaluationRow> tests_;
  bool paused_ = false;
  double share_ = 0;
  std::string ended_;
};

}  // namespace raysplats::view
