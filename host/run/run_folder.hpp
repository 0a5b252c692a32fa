// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/evaluation_row.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"
#include "raysplats/train_options.hpp"
#include "util/file_lock.hpp"

namespace raysplats {

/// One row of metrics.csv.
struct TrainRow {
  std::int64_t iteration = 0;
  double seconds = 0;  ///< of training, evaluation excluded
  double loss = 0;
  double psnr = 0;  ///< of the view just trained
  std::size_t gaussians = 0;
  double iterations_per_second = 0;
  std::uint64_t candidates = 0;  ///< (tile, Gaussian) pairs of the last view, 0 ray by ray
  std::uint64_t hits = 0;        ///< blended (ray, Gaussian) pairs of the last view, 0 ray by ray
};

/// The folder of one training run: config.toml, cameras.json, metrics.csv, metrics.json,
/// checkpoints/, eval/, point_cloud/iteration_N/point_cloud.ply, and .lock while it trains (the
/// file stays, the lock on it does not).
class RunFolder {
 public:
  /// Throws DataError when the folder cannot be written to; lock() makes it. One of several ranks
  /// that share a run `writes`; the others know the same, and leave the folder alone.
  explicit RunFolder(std::filesystem::path path, bool writes = true);

  const std::filesystem::path& path() const { return path_; }
  std::filesystem::path evaluation_folder(std::int64_t iteration) const;

  void write_config(const TrainOptions& options) const;
  /// cameras.json as the viewers of 3DGS read it: centre and camera-to-world rotation of every
  /// view. They skip its principal point and lens, which are there by the keys of a
  /// transforms.json.
  void write_cameras(std::span<const Camera> cameras) const;
  /// Writes exposures.json: the 3 x 4 colour matrix of every training photo, by its name. `deltas`
  /// as in Exposure::State.
  void write_exposures(std::span<const Camera> cameras, std::span<const float> deltas) const;
  /// cameras_refined.json, as write_cameras() of io.hpp does it, in the coordinates of the data
  /// set's files, whose `origin` was taken off.
  void write_refined_cameras(std::vector<Camera> cameras,
                             const std::array<double, 3>& origin) const;
  /// Writes moving/NAME.EXT.png, a mask of the photo of that name, as COLMAP calls masks. In any
  /// thread.
  void write_moving(const std::string& photo, const Image& mask) const;
  /// Removes all masks.
  void remove_moving() const;
  /// `trace` goes into the header, for those who take the model elsewhere. Numbers that are not
  /// finite are kept: what a run that diverged has learnt is not to be lost.
  void write_model(const Gaussians& model,
                   const TraceOptions& trace,
                   std::int64_t iteration,
                   const std::array<double, 3>& origin = {}) const;
  /// What evaluate() has written of that iteration.
  void remove_evaluation(std::int64_t iteration) const;
  bool has_model(std::int64_t iteration) const;
  /// The iteration of the newest model in the folder.
  std::optional<std::int64_t> newest_model() const;
  void remove_model(std::int64_t iteration) const;
  /// The XXH3 of 128 bits of that model's file, in hexadecimal digits as `xxh128sum` prints it; ""
  /// without the file.
  std::string model_hash(std::int64_t iteration) const;

  /// Makes the folder where there is none, keeps other runs out of it until the lock goes, and
  /// removes temporary files that a killed run left. Throws DataError when the folder cannot be
  /// made, and when another run has it.
  [[nodiscard]] FileLock lock() const;

  /// Removes what a run has written for iterations after `iteration`, and with 0 its reports and
  /// configuration too. Files that no run writes stay.
  void remove_after(std::int64_t iteration) const;

  /// Starts metrics.csv and the evaluations anew, keeping what was recorded up to `iteration` (0
  /// keeps nothing).
  void begin_metrics(std::int64_t iteration);
  /// The rows that it kept: iteration, seconds, loss and PSNR alone.
  const std::vector<TrainRow>& former_rows() const { return rows_; }
  /// What metrics.json said then, to be read with former_metrics.hpp; null without one.
  std::shared_ptr<const nlohmann::json> former_metrics() const { return former_; }
  void append(const TrainRow& row);
  /// Takes the place of an evaluation of the same iteration.
  void record(const EvaluationRow& row);
  const std::vector<EvaluationRow>& evaluations() const { return evaluations_; }
  /// The same of validation views, with the PSNR that decides in `psnr`.
  void record_validation(const EvaluationRow& row) { validations_.push_back(row); }
  const std::vector<EvaluationRow>& validations() const { return validations_; }
  /// metrics.json: the evaluations, and `summary` when the run is over or interrupted.
  void write_metrics(const nlohmann::json& summary) const;

 private:
  std::filesystem::path path_;
  bool writes_;
  std::vector<EvaluationRow> evaluations_, validations_;
  std::vector<TrainRow> rows_;
  std::shared_ptr<const nlohmann::json> former_;
};

/// Throws UsageError when a folder holds files of a run, with which another one would mix.
void check_no_run(const std::filesystem::path& folder);

/// The PSNR that a run is judged by: with moved cameras where that was measured, or else, with
/// `exposures` that are trained, with corrected colours.
double judged_psnr(const EvaluationRow& row, bool exposures);

/// The best of the evaluations before the last one by judged_psnr(), among those that saw as many
/// views and measured the same, if the last one ended more than `margin` decibels below it.
std::optional<EvaluationRow> better_before(std::span<const EvaluationRow> evaluations,
                                           bool exposures = false,
                                           double margin = 0.1);

/// Seconds of training that the metrics.csv of a run folder has recorded up to `iteration`; 0 when
/// it has none.
double recorded_seconds(const std::filesystem::path& run_folder, std::int64_t iteration);

}  // namespace raysplats
