// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/evaluation_row.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/train_options.hpp"

namespace raysplats {

class Communicator;
struct DeviceGaussians;
class RunWatcher;

/// What a run has done.
struct TrainSummary {
  std::int64_t iterations = 0;      ///< completed, those before resume() included
  std::size_t gaussians = 0;        ///< of the model
  double loss = 0;                  ///< of the last view reported
  double training_seconds = 0;      ///< evaluation, files and compiling kernels excluded
  double evaluation_seconds = 0;    ///< of the test views
  double kernel_build_seconds = 0;  ///< of the context so far
  std::vector<EvaluationRow>
      evaluations;  ///< the last one is that of the final model, when there are test views
};

/// What a run will take, from steps that were timed.
struct RunEstimate {
  std::int64_t iterations = 0;  ///< of the whole run
  std::size_t gaussians = 0;    ///< at its end, if densification reaches its limit
  double seconds = 0;           ///< of training, as TrainSummary::training_seconds
  /// Evaluations and validations that run() makes beside training, and the views of all of them.
  std::size_t evaluations = 0;
  std::size_t evaluated_views = 0;
};

/// Where a run is after a step.
struct TrainProgress {
  std::int64_t iteration = 0;   ///< completed
  std::int64_t iterations = 0;  ///< of the whole run
  std::size_t gaussians = 0;    ///< of the model now
};

/// Measures of the view that the last step was made with, before that step.
struct TrainLoss {
  double total = 0;  ///< the whole loss
  double psnr = 0;   ///< decibels
};

/// Trains a model of a data set and writes a run folder (Kerbl et al. 2023 with the gradients of
/// Byrski et al. 2025; docs/model.md). A run is a function of data set, options and device: resumed
/// from a checkpoint it continues bit for bit. Either run() does everything that the options'
/// schedule says, or step(), evaluate() and save() are called in a loop of one's own.
///
/// Threads: as Context, iteration by iteration; stop() may be called from any thread. A trainer
/// that is in run() or step() refuses another one and resume(), from another thread or from its own
/// callback.
class Trainer {
 public:
  /// Throws UsageError for options that cannot be trained or say otherwise than the data set how it
  /// was read, ResourceError when the device has too
  /// little memory, DataError when the run folder cannot be written to. With `overwrite` the run
  /// takes the place of one that is in the folder, whose files are removed when training starts;
  /// without, a folder that holds another run is refused then. Views whose masks ignore all of
  /// their photos are left out with a warning; DataError where none to train on is left.
  ///
  /// `ranks`, which outlives the trainer, is of the library itself; its type is not installed. With
  /// it every rank makes a trainer of its own with the same arguments, and calls what trains,
  /// measures or saves like all others. Each traces its share of the views of a step; all hold the
  /// same model, that of a run alone, and the rank that leads writes. Throws UsageError for fewer
  /// views a step than ranks, RankLost when one has ended.
  Trainer(Context& context,
          Dataset dataset,
          const TrainOptions& options,
          std::filesystem::path run_folder,
          bool overwrite = false,
          Communicator* ranks = nullptr);
  ~Trainer();

  /// Continues from the newest valid checkpoint of a run folder, or from a checkpoint file, instead
  /// of starting anew; "latest" is the run's own folder, and starts anew while that holds none.
  /// Throws UsageError when it does not fit the options or was made with other data, and without
  /// `overwrite` when the run's folder holds later models of a run of another length; DataError
  /// when there is none that is whole or another run has the folder.
  void resume(const std::filesystem::path& source);

  /// How long the run will take. Times steps of a small run of the same shape for about `seconds`
  /// (less when the estimate is that short; a start and some photos come on top) and puts
  /// everything back: the run is as without. With `show_progress` stderr tells how far reading many
  /// photos is. Throws UsageError once training has begun.
  RunEstimate estimate(double seconds, bool show_progress = false);
  /// Sets options.iterations, and max_gaussians where that is 0, so that measuring (a twentieth of
  /// it, at most ten minutes) and training take `seconds`; RUN/config.toml names both. When the
  /// run's last steps have begun, some are timed and options.end_iteration is set to where the time
  /// will be over, there too. `show_progress` is as in estimate(). Throws UsageError once training
  /// has begun, and for a time in which nothing can be trained or that is beyond 1e9 s.
  RunEstimate fit_time(double seconds, bool show_progress = false);

  /// Trains up to options.iterations, or end_iteration. SIGINT, SIGTERM, SIGHUP and, where it would
  /// end the process, SIGPIPE finish the iteration, break off an evaluation, which the run that
  /// goes on makes up for, save a checkpoint and the model and throw Error(kInterrupted). Ten steps
  /// in a row that are not finite (StepGuard) leave RUN/dump and throw Error(kRuntime) naming the
  /// iteration.
  /// After other failures, and after an exception from a callback, the last whole state is saved
  /// when the device still gives it, and the error says which iteration that is; what a callback
  /// throws comes out as it is. Throws DataError when another run has the folder.
  TrainSummary run(bool show_progress = true);

  /// Makes at most `count` iterations more, without the evaluations and files of the schedule;
  /// returns whether iterations are still to come. Throws UsageError for a count below 1, and what
  /// run() throws for a model that is damaged.
  bool step(std::int64_t count = 1);
  /// The command line that started the run, which RUN/metrics.json is to name.
  void set_command(std::string command);
  /// `callback` hears of every iteration of run() and step(), in their thread, before density
  /// control; nullptr ends that. It may use this trainer's loss(), model(), evaluate(), save() and
  /// stop(). Throws UsageError for a callback while run() or step() is under way, which keeps its
  /// own.
  void on_step(std::function<void(const TrainProgress&)> callback);
  /// Ends run() or step() after the iteration that is under way, without an evaluation that the
  /// schedule may have after it. run() then saves as it does for a signal, and returns: its summary
  /// has fewer iterations than the options.
  void stop();

  /// Traces the test views, writes RUN/eval and RUN/metrics.json. Throws UsageError when the data
  /// set has no test views.
  EvaluationRow evaluate();
  /// Writes the model and a checkpoint into the run folder, from which resume() goes on. While
  /// run() or step() is under way: at the end of its iteration.
  void save();

  /// Loss and PSNR of the last step's view; blocks. Throws UsageError before the first step.
  TrainLoss loss();
  /// The model as it would be saved now, in the last steps the mean of theirs
  /// (TrainOptions::average_from); without Gaussians before the first step.
  Gaussians model() const;
  /// Completed iterations.
  std::int64_t iteration() const;
  /// Iterations of the whole run, as it is planned now.
  std::int64_t iterations() const;

  // What follows serves the library itself; its types are not installed.

  /// The parameters in training, on the device; the same object as long as the trainer lives.
  const DeviceGaussians& gaussians() const;
  /// Lets `watcher`, which outlives the run, look at it between steps; nullptr ends that.
  void set_watcher(RunWatcher* watcher);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
