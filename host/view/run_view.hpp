// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/trace_options.hpp"
#include "train/run_watcher.hpp"
#include "view/gaussian_pictures.hpp"
#include "view/run_history.hpp"
#include "view/time_share.hpp"
#include "view/viewer.hpp"

namespace raysplats::view {

/// Shows a run to pages while it trains: its model, drawn between steps within a share of the time
/// that the pages set, and what metrics.csv says. Pages pause it, resume it and let it save.
/// Nobody who looks changes what is trained, and while nobody does nothing is drawn.
class RunView : public RunWatcher {
 public:
  /// Listens. `gaussians` are the trainer's. The `run` of the options is set here.
  RunView(Context& context,
          const DeviceGaussians& gaussians,
          const TraceOptions& trace,
          const Mirrors& mirrors,
          std::int64_t iterations,
          ViewerOptions options);

  /// As Server::urls().
  std::vector<std::string> urls() const;
  /// Tells the pages that the run is over, and why.
  void finish(const std::string& text);

  void noted(const TrainRow& row) override;
  void evaluated(const EvaluationRow& row) override;
  void will_end(std::int64_t iteration) override;
  bool wants_look() override;
  RunWish look(const RunMoment& moment, const std::function<bool()>& stopping) override;

 private:
  void obey(const RunCommand& command);

  using Clock = std::chrono::steady_clock;

  RunHistory history_;
  GaussianPictures pictures_;
  TimeShare time_;
  Clock::time_point last_ = Clock::now();  ///< of wants_look()
  bool paused_ = false;
  bool save_ = false;
  Viewer viewer_;  // last: its thread uses the history
};

}  // namespace raysplats::view
