// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "comm/communicator.hpp"
#include "device/read_back.hpp"
#include "eval/kept_pictures.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "run/run_folder.hpp"
#include "scene/image/pixel_mask.hpp"
#include "train/busy_trainer.hpp"
#include "train/density/density_control.hpp"
#include "train/density/mcmc.hpp"
#include "train/loss/depth_supervision.hpp"
#include "train/loss/exposure.hpp"
#include "train/loss/image_loss.hpp"
#include "train/loss/photo_cache.hpp"
#include "train/loss/photo_fit.hpp"
#include "train/memory_estimate.hpp"
#include "train/model_validator.hpp"
#include "train/optimizer/adam.hpp"
#include "train/optimizer/footprint.hpp"
#include "train/optimizer/gradient_tree.hpp"
#include "train/optimizer/parameter_mean.hpp"
#include "train/optimizer/pose_refinement.hpp"
#include "train/optimizer/sky_adam.hpp"
#include "train/optimizer/step_guard.hpp"
#include "train/psnr_rise.hpp"
#include "train/run_time.hpp"
#include "train/run_watcher.hpp"
#include "train/schedule.hpp"
#include "train/start/initialization.hpp"
#include "train/start/photo_set.hpp"
#include "train/stopwatch.hpp"
#include "util/file_lock.hpp"
#include "util/progress.hpp"

namespace raysplats {

/// Photos decoded ahead of their turn.
constexpr std::size_t kReadAhead = 8;

/// One of the views of a step, and what its gradient leaves besides.
struct ViewSlot {
  std::size_t view = 0;        ///< position among the training views
  PoseGradient pose_gradient;  ///< where poses are trained
};

/// What the last view of a step says of itself.
struct LastView {
  ImageLoss::Value loss;
  CameraTracer::Statistics work;
};

/// The clocks of a run.
struct RunClock {
  Stopwatch training, evaluating;
  std::optional<double> run_seconds = {};     ///< that fit_time() was given
  std::optional<double> steady_seconds = {};  ///< of training, when the last steps began
  std::int64_t row_iteration = 0;             ///< of the last row of progress
  double row_seconds = 0;                     ///< of training, then
};

/// How views are measured.
struct MeasureWatch {
  std::FILE* terminal = nullptr;        ///< on which a bar shows how far it is
  std::function<bool()> stopping = {};  ///< asked picture by picture whether to break it off
};

/// What a run is asked to do between two steps.
struct Asked {
  std::atomic<bool> stop = false;
  std::atomic<bool> save = false;
  bool stop_wished = false;  ///< before a step, by this rank; with several ranks
  bool stop_agreed = false;  ///< after it: by any of them
};

/// A step that is enqueued and may not be done, with what its beginning found on the host.
struct SentStep {
  std::int64_t iteration;
  std::int64_t optimiser_steps;
  std::uint64_t traced_rays;
  ReadBack overflow;  ///< ViewTracer::overflow() after it
};

// The state of a run. Its functions stand in files by what they are for.
struct Trainer::Impl {
  Impl(Context& device,
       Dataset data,
       const TrainOptions& train_options,
       std::filesystem::path run_path,
       bool replace,
       Communicator* others);

  // trainer.cpp: what views and options do not allow together, what photos may take.
  void check_views_and_options() const;
  std::shared_ptr<const ViewPicture> evaluated_photo(std::size_t view);

  // trainer_start.cpp: from a data set to the first step.
  void start();
  void load_former_metrics();
  Gaussians new_model(std::size_t most);
  void make_first_model();
  void upload_first_model(std::size_t most);
  std::vector<std::size_t> first_views() const;
  const std::vector<SmallPhoto>& photos(PhotoChoice choice);
  std::vector<SmallPhoto> reduced_photos(std::span<const std::size_t> views) const;
  MemoryDemand demand(std::size_t count) const;
  void check_room(std::size_t count, std::size_t most) const;
  void choose_background();
  void warn_of_photos();
  void choose_color_range();
  void reset_exposure();
  void reset_sky();
  void reset_poses();
  std::int64_t turn_of(std::size_t slot) const;
  std::int64_t last_turn() const;
  std::size_t limit() { return most_gaussians(options.iterations); }
  std::size_t most_gaussians(std::int64_t iterations);
  std::size_t largest_photo() const;
  std::size_t photo_words() const;
  std::size_t ray_views(int divisor = 1) const;
  void require_depth_gradients() const;

  // trainer_step.cpp: one step, and what happens between two of them.
  void enqueue_view(std::size_t slot);
  void enqueue_views();
  void enqueue_step();
  void control_density();
  void apply_plan(const DensityPlan& plan);

  // trainer_ranks.cpp: what ranks that share the run tell each other.
  void read_ahead(std::int64_t turn);
  bool sum_views();
  void exchange_slots();
  void check_ranks_agree();
  LastView last_view();

  // trainer_pilot.cpp: how long a run will take.
  struct Pilot;
  struct PilotSteps;
  void check_not_begun(const char* function) const;
  void apply_options();
  double predicted_seconds(const Pilot& pilot, std::int64_t iterations, std::size_t most) const;
  void begin_programs(std::initializer_list<int> degrees);
  Pilot run_pilot(double seconds, std::optional<double> run_time);
  void time_steps(double seconds, std::optional<double> run, Pilot& pilot);
  void undo_pilot();
  RunEstimate with_evaluations(RunEstimate training) const;
  RunEstimate estimate(double seconds);
  RunEstimate fit_time(double seconds);
  bool fit_end_to_time();
  void tell_fitted_end() const;

  // trainer_validation.cpp: training views that judge the run.
  std::int64_t join_iteration() const;
  std::size_t loss_views() const;
  std::size_t pass_views() const;
  void restore_joined_views(const Checkpoint& checkpoint);
  bool validation_due() const;
  bool is_validated() const;
  bool validate_views(const MeasureWatch& watch);
  bool out_of_patience() const;
  void keep_best_model();

  // trainer_agreement.cpp: training photos that contradict each other.
  void order_views();
  std::vector<std::size_t> odd_views();
  void leave_out_odd_views();
  void store_left_out(Checkpoint& checkpoint, CheckpointSections& sections) const;
  void restore_left_out(const Checkpoint& checkpoint);

  // trainer_moving.cpp: what moves or changes from photo to photo.
  std::vector<PixelMask> moving_views();
  void set_moving(std::vector<PixelMask> found);
  std::int64_t last_look() const;
  void warn_of_late_look() const;
  void leave_out_moving_areas();
  void write_moving() const;
  void store_moving(CheckpointSections& sections) const;
  void restore_moving(const Checkpoint& checkpoint);

  // trainer_pace.cpp: steps on their way.
  void send_step();
  void send_sampled_step();
  void collect_done(bool all);
  void finish_steps();
  void drop_unfinished();
  void rewind();

  // trainer_checks.cpp: what stops a run.
  StepGuard::Counts check_guard();
  void validate_model();
  void write_dump();

  // trainer_report.cpp: what a run says of itself.
  void report(Progress& progress);
  bool evaluate_views(bool last, const MeasureWatch& watch = {});
  bool is_evaluated(bool last) const;
  std::optional<EvaluationRow> measure(const Dataset& views,
                                       const std::filesystem::path& folder,
                                       EvaluationOptions choice,
                                       const MeasureWatch& watch);
  void set_background();
  TraceOptions trace_options();                  // that the model looks right with
  const DeviceGaussians& model_to_show() const;  // the mean of the last steps, if they have begun
  Gaussians model_to_save() const;               // of these, without what has left --bounds
  const DeviceGaussians& model_to_measure(DeviceGaussians& room) const;
  void save_model();
  nlohmann::json photo_report() const;
  void write_metrics(bool complete);
  std::string capped_share(std::uint64_t capped);
  void tell_of_capped_rays(std::uint64_t capped) const;
  void warn_of_no_progress() const;

  // trainer_resume.cpp: checkpoints.
  void resume(const std::filesystem::path& source);
  void restore_from(const std::filesystem::path& source);
  void check_fits(const Checkpoint& checkpoint) const;
  void choose_folder(const std::filesystem::path& place, const Checkpoint& checkpoint);
  void restore_parts(const Checkpoint& checkpoint);
  void check_lists(const Checkpoint& checkpoint) const;
  void check_data_options(const Checkpoint& checkpoint) const;
  void check_newer_models(std::int64_t from) const;
  void write_state(const std::filesystem::path& path);
  void save_checkpoint();
  std::string rescue();

  // trainer_loop.cpp: iterations by the schedule.
  TrainSummary train(bool show_progress);
  bool run_steps(std::int64_t count);
  void begin_stepping();
  bool saves_model(std::int64_t at) const;
  void run_and_rescue(std::int64_t until,
                      bool scheduled,
                      bool show_progress,
                      const std::function<bool()>& interrupted);
  struct Loop;
  void run_iterations(std::int64_t until, const Loop& loop);
  bool run_iteration(const Loop& loop);
  bool finish_iteration(const Loop& loop, bool stop, bool anew);
  void untimed(const Loop& loop, const std::function<void()>& work);
  MeasureWatch watch_of(const Loop& loop) const;
  void let_watcher_look(const std::function<bool()>& interrupted);

  Context& context;
  Communicator alone;
  Communicator& ranks;
  Dataset dataset;
  DatasetOptions said_data;  // by the options, before the data set told how it was read
  TrainOptions options;
  RunFolder run;
  bool overwrite;
  bool continues = false;  // what is in the folder is of this run
  std::vector<std::size_t> train_views;
  std::vector<std::size_t> test_views;
  std::vector<Camera> train_cameras;
  double extent;
  float motion = 0;  // motion_extent() of the first model
  bool cut_out;
  std::string command;  ///< that started the run
  std::string fingerprint;
  std::array<float, 3> background;
  ViewTracer tracer;
  ImageLoss loss;
  Adam adam;
  // Positions in train_views that stay out of the loss until join_iteration().
  std::vector<std::size_t> apart;
  std::optional<std::int64_t> joined;  // when they joined, if the run was to be shorter then
  CrowdedPlaces crowded;               // by positions in train_views
  // Positions in train_views that contradict the others, and the iterations before those that do
  // without them.
  std::vector<std::size_t> left_out;
  std::int64_t left_out_from = 0;
  std::vector<PixelMask> moving;  // of all train_views, what is left out of their photos
  DensityControl density;
  Footprint footprint;
  ParameterMean mean;
  std::optional<Exposure> exposure;        // with the option
  std::optional<DepthSupervision> depths;  // likewise
  std::optional<SkyAdam> sky;              // with a background that is one; the tracer has it
  std::optional<PoseRefinement> poses;     // with the option
  std::optional<Mcmc> mcmc;                // with the strategy
  StepGuard guard;
  PhotoFit fit;
  std::optional<ModelValidator> validator;  // once it is asked for
  PhotoCache photo_cache;
  std::optional<KeptPictures> evaluated_photos;  // once one is asked for; of views by their number
  ViewOrder order{0, 0};  // of views, of which a step takes several (apply_options())

  DeviceGaussians gaussians;
  std::vector<ViewSlot> slots;  // views-per-step
  RankShare share;              // of the slots, that this rank traces
  StepGradients gradients;      // of the last view, then of the step
  GradientTree sum;
  Buffer<float> image_gradient;
  std::int64_t iteration = 0;                                   // completed
  std::map<std::size_t, std::vector<SmallPhoto>> small_photos;  // so many, once asked for
  std::optional<Gaussians> first_model;                         // made before start()
  bool poses_checked = false;   // by a first model, of which --time may make two
  bool shows_progress = false;  // of what precedes the first step
  bool started = false;
  bool ended = false;    // before its time, by patience
  bool cut_off = false;  // with the evaluation of its newest iteration still to be made
  bool whole = false;  // the device holds the state after `iteration` iterations, nothing half done
  bool pass_due = false;    // of density control, after the newest step
  std::int64_t saved = -1;  // iteration of the newest checkpoint of this run
  std::uint32_t reported_bad_steps = 0;
  std::uint64_t traced_rays = 0;     // of all training views of the run, reflected ones with them
  std::uint64_t reflected_rays = 0;  // by mirrors, in the views of the step
  std::deque<SentStep> sent;         // the oldest first
  bool await_sizes = false;          // of the next step: its view had too little room
  std::uint64_t made_again = 0;      // steps that had
  bool cap_reported = false;
  std::int64_t timed_steps = 0;         // whose kernels were timed
  std::uint64_t skipped_before = 0;     // updates of Adam, before resume()
  std::optional<TrainOptions> resumed;  // options of the run that resume() has brought
  // What the run has warned of: by its photos, once, and by its cameras, at each start.
  std::vector<std::string> photo_warnings, camera_warnings;
  std::shared_ptr<const nlohmann::json> former;  // metrics.json before this object's first start()
  PsnrRise rise;
  RunClock clock{Stopwatch(context), Stopwatch(context)};
  double last_loss = 0;

  std::function<void(const TrainProgress&)> callback;
  RunWatcher* watcher = nullptr;
  Asked asked;
  std::atomic<bool> busy = false;  // in run() or step()
  bool stepped = false;            // since this object was made
  bool reads_ahead = true;         // photos, before their turn
  bool prepared = false;           // for steps of the caller's own
  std::optional<FileLock> folder_lock;

  [[noreturn]] static void refuse_while_busy() {
    refuse_busy_trainer("run(), step(), resume() and on_step()");
  }
  // Marks the trainer as busy while it lives.
  struct Busy {
    explicit Busy(Impl& impl) : busy(impl.busy) {
      if (busy.exchange(true)) refuse_while_busy();
      impl.asked.stop = false;
    }
    ~Busy() { busy = false; }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;
    std::atomic<bool>& busy;
  };
  // Keeps other runs out of the folder while it lives.
  struct FolderUse {
    explicit FolderUse(Impl& impl_in)
        : impl(impl_in), own(impl.ranks.leads() && !impl.folder_lock) {
      if (own) impl.folder_lock.emplace(impl.run.lock());
    }
    ~FolderUse() {
      if (own) impl.folder_lock.reset();
    }
    FolderUse(const FolderUse&) = delete;
    FolderUse& operator=(const FolderUse&) = delete;
    Impl& impl;
    bool own;
  };
};

}  // namespace raysplats
