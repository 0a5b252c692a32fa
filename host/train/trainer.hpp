// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "device/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/train_options.hpp"
#include "trace/device_gaussians.hpp"
#include "train/run_folder.hpp"

namespace raysplats {

struct TrainSummary {
  std::int64_t iterations = 0;
  std::size_t gaussians = 0;
  double loss = 0;              ///< of the last view trained
  double training_seconds = 0;  ///< evaluation and files excluded
  double evaluation_seconds = 0;
  std::vector<EvaluationRow>
      evaluations;  ///< the last one is that of the final model, when there are test views
};

/// Trains a model of a data set and writes a run folder. A run is a function of
/// data set, options and device: resumed from a checkpoint it continues bit for bit.
class Trainer {
 public:
  /// Throws UsageError for options that cannot be trained, ResourceError when the device has too
  /// little memory, DataError when the run folder cannot be written to.
  Trainer(Context& context,
          Dataset dataset,
          const TrainOptions& options,
          std::filesystem::path run_folder);
  ~Trainer();

  /// Continues from the newest valid checkpoint of a run folder, or from a checkpoint file, instead
  /// of starting anew; "latest" is the run's own folder, and starts anew while that holds none.
  /// Throws UsageError when it does not fit the options or was made with other data, DataError when
  /// there is none that is whole or another run has the folder.
  void resume(const std::filesystem::path& source);

  /// Trains up to options.iterations. SIGINT and SIGTERM finish the iteration, save a checkpoint
  /// and the model and throw Error(kInterrupted). Ten steps in a row that are not finite
  /// (StepGuard) leave RUN/dump and throw Error(kRuntime) naming the iteration. After other
  /// failures the last whole state is saved when the device still gives it, and the error says
  /// which iteration that is. Throws DataError when another run has the folder.
  TrainSummary run(bool show_progress = true);

  /// The model as it is now; completed iterations.
  const DeviceGaussians& gaussians() const;
  std::int64_t iteration() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
