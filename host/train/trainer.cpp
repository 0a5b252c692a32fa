// SPDX-License-Identifier: Apache-2.0
#include "raysplats/trainer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <map>
#include <new>
#include <nlohmann/json.hpp>
#include <optional>
#include <system_error>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/interrupt.hpp"
#include "base/progress.hpp"
#include "core/morton_order.hpp"
#include "eval/metrics.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "train/adam.hpp"
#include "train/checkpoint.hpp"
#include "train/dataset_fingerprint.hpp"
#include "train/density_control.hpp"
#include "train/exposure.hpp"
#include "train/footprint.hpp"
#include "train/image_loss.hpp"
#include "train/initialization.hpp"
#include "train/memory_estimate.hpp"
#include "train/mirror_meshes.hpp"
#include "train/model_validator.hpp"
#include "train/photo_set.hpp"
#include "train/run_folder.hpp"
#include "train/run_state.hpp"
#include "train/schedule.hpp"
#include "train/step_guard.hpp"
#include "train/target_cache.hpp"
#include "train/train_config.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr int kSmallPhoto = 200;         // longer side of photos that the start looks at, in pixels
constexpr std::size_t kMeanPhotos = 24;  // whose typical colour is the background
constexpr std::size_t kReadAhead = 8;    // photos decoded ahead of their turn
constexpr int kViewsToJudge = 3;         // reports of views that were reported before
constexpr double kLeastRise = 0.1;       // decibels that a run has to gain
constexpr double kManyCapped = 1e-3;     // share of rays at which the cap on hits gets a warning

// A clock that can be stopped, and stands while kernels are compiled.
class Stopwatch {
 public:
  explicit Stopwatch(const Context& context) : context_(&context) {}
  void start() {
    begun_ = std::chrono::steady_clock::now();
    built_ = context_->build_seconds();
  }
  void stop() { seconds_ = seconds(), begun_.reset(); }
  void set(double seconds) { seconds_ = seconds; }
  double seconds() const {
    if (!begun_) return seconds_;
    return seconds_ +
           std::chrono::duration<double>(std::chrono::steady_clock::now() - *begun_).count() -
           (context_->build_seconds() - built_);
  }

 private:
  const Context* context_;
  double seconds_ = 0;
  double built_ = 0;  // build_seconds() at the start
  std::optional<std::chrono::steady_clock::time_point> begun_;
};

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

std::vector<Camera> cameras_of(const Dataset& dataset, const std::vector<std::size_t>& views) {
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const std::size_t view : views) cameras.push_back(dataset.views[view].camera);
  return cameras;
}

TraceOptions trace_options_of(const TrainOptions& options, const std::array<float, 3>& background) {
  TraceOptions trace;
  trace.quantile = static_cast<float>(options.quantile);
  trace.min_transmittance = static_cast<float>(options.min_transmittance);
  trace.max_hits = options.max_hits;
  trace.hit_order = options.hit_order;
  trace.adaptive_radius = options.adaptive_radius;
  trace.near_depth = static_cast<float>(options.near_depth);
  trace.traversal = options.traversal;
  trace.background = background;
  trace.packet_form = options.packet_form;
  trace.packet_width = options.packet_width;
  trace.gradient_sum = options.gradient_sum;
  trace.deterministic = options.deterministic;
  trace.launch_budget_ms = options.launch_budget_ms;
  trace.memory_budget = static_cast<std::size_t>(options.memory_budget) * kMiB;
  return trace;
}

AdamOptions adam_options_of(const TrainOptions& options) {
  AdamOptions adam;
  adam.beta1 = options.adam_beta1;
  adam.beta2 = options.adam_beta2;
  adam.epsilon = options.adam_epsilon;
  adam.visible_only = options.sparse_adam;
  return adam;
}

AdamRates adam_rates_of(const TrainOptions& options, double extent, std::int64_t iteration) {
  AdamRates rates;
  rates.means = extent * learning_rate(options.position_lr, options, iteration);
  rates.quaternions = learning_rate(options.rotation_lr, options, iteration);
  rates.scales = (options.scale_lr_by_extent ? extent : 1.0) *
                 learning_rate(options.scale_lr, options, iteration);
  rates.opacities = learning_rate(options.opacity_lr, options, iteration);
  rates.sh_dc = learning_rate(options.sh_lr, options, iteration);
  rates.sh_rest = learning_rate(options.sh_rest_lr, options, iteration);
  return rates;
}

std::vector<View> views_of(const Dataset& dataset, const std::vector<std::size_t>& indices) {
  std::vector<View> views;
  views.reserve(indices.size());
  for (const std::size_t index : indices) views.push_back(dataset.views[index]);
  return views;
}

// Host memory for decoded photos: enough to read ahead, or all within the budget when a later
// resolution needs them again.
std::size_t host_image_budget(const TrainOptions& options, const std::vector<Camera>& cameras) {
  if (!options.resolution_schedule.empty())
    return static_cast<std::size_t>(options.image_budget) * kMiB;
  std::size_t largest = 0;
  for (const Camera& camera : cameras) largest = std::max(largest, 4 * pixels_of(camera));
  return kReadAhead * largest;
}

// The same error with a remark at its end.
[[noreturn]] void throw_with(const Error& error, const std::string& remark) {
  const std::string message = fmt::format("{}; {}", error.what(), remark);
  switch (error.code()) {
    case ErrorCode::kUsage:
      throw UsageError(message);
    case ErrorCode::kData:
      throw DataError(message);
    case ErrorCode::kDevice:
      throw DeviceError(message);
    case ErrorCode::kMemory:
      throw ResourceError(message);
    default:
      throw Error(error.code(), message);
  }
}

bool contains(const std::vector<RunShare>& list, std::int64_t iterations, std::int64_t value) {
  return std::any_of(list.begin(), list.end(), [iterations, value](const RunShare& share) {
    return share.of(iterations) == value;
  });
}

bool every(std::int64_t period, std::int64_t iteration) {
  return period > 0 && iteration % period == 0;
}

}  // namespace

struct Trainer::Impl {
  Impl(Context& device,
       Dataset data,
       const TrainOptions& train_options,
       std::filesystem::path run_path,
       bool replace);

  void start();
  const std::vector<SmallPhoto>& photos();
  void choose_background();
  std::size_t limit();
  std::size_t largest_photo() const;
  std::size_t ray_views() const;
  void check_data_options(const Checkpoint& checkpoint) const;
  void finish_resumed();
  void step();
  void report(Progress& progress);
  void control_density();
  void evaluate_views(bool last);
  void save_model();
  void resume(const std::filesystem::path& source);
  Checkpoint state();
  void save_checkpoint();
  void check_guard();
  void validate_model();
  void write_dump();
  std::string rescue();
  std::uint64_t capped_rays() const { return capped_before + tracer.kept_capped_rays(); }
  std::string capped_share();
  void warn_of_capped_rays() const;
  void note_rise(double psnr);
  void warn_of_no_progress() const;
  void write_metrics(bool complete);
  void run_iterations(std::int64_t until,
                      bool scheduled,
                      Progress& progress,
                      const std::function<bool()>& interrupted);
  void advance(std::int64_t until,
               bool scheduled,
               bool show_progress,
               const std::function<bool()>& interrupted);
  TrainSummary train(bool show_progress);
  bool train_some(std::int64_t count);
  void prepare();

  Context& context;
  Dataset dataset;
  TrainOptions options;
  RunFolder run;
  bool overwrite;
  bool continues = false;  // what is in the folder is of this run
  std::vector<std::size_t> train_views;
  std::vector<std::size_t> test_views;
  std::vector<Camera> train_cameras;
  double extent;
  bool cut_out;
  std::string fingerprint;
  std::array<float, 3> background;
  ViewTracer tracer;
  ImageLoss loss;
  Adam adam;
  DensityControl density;
  Footprint footprint;
  std::optional<Exposure> exposure;  // with the option
  StepGuard guard;
  std::optional<ModelValidator> validator;  // once it is asked for
  TargetCache targets;
  ViewOrder order;

  DeviceGaussians gaussians;
  GaussianGradients gradients;
  Buffer<float> image_gradient;
  std::int64_t iteration = 0;            // completed
  std::vector<SmallPhoto> small_photos;  // once they are asked for
  bool started = false;
  bool whole = false;  // the device holds the state after `iteration` iterations, nothing half done
  std::int64_t saved = -1;  // iteration of the newest checkpoint of this run
  std::uint32_t reported_bad_steps = 0;
  std::uint64_t traced_rays = 0;    // of all training views of the run
  std::uint64_t capped_before = 0;  // rays that stopped at max-hits before it was resumed
  bool cap_reported = false;
  std::map<std::pair<std::size_t, int>, double> first_psnr;  // by view and divisor, as reported
  std::optional<double> psnr_rise;  // the most that a view has gained over its first report
  int views_seen_again = 0;
  Stopwatch training{context};
  Stopwatch evaluating{context};
  double last_loss = 0;
  std::int64_t row_iteration = 0;
  double row_seconds = 0;

  std::function<void(const TrainProgress&)> callback;
  std::atomic<bool> stop_asked = false;
  std::atomic<bool> save_asked = false;
  std::atomic<bool> busy = false;  // in run() or step()
  bool stepped = false;            // since this object was made
  bool prepared = false;           // for steps of the caller's own
  std::optional<FileLock> folder_lock;

  // Marks the trainer as busy while it lives.
  struct Busy {
    explicit Busy(Impl& impl) : busy(impl.busy) {
      if (busy.exchange(true)) {
        throw UsageError(
            "The trainer is training already: wait for its run() or step(), and call neither from "
            "its callback");
      }
      impl.stop_asked = false;
    }
    ~Busy() { busy = false; }
    Busy(const Busy&) = delete;
    Busy& operator=(const Busy&) = delete;
    std::atomic<bool>& busy;
  };
  // Keeps other runs out of the folder while it lives.
  struct FolderUse {
    explicit FolderUse(Impl& impl_in) : impl(impl_in), own(!impl.folder_lock) {
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

Trainer::Impl::Impl(Context& device,
                    Dataset data,
                    const TrainOptions& train_options,
                    std::filesystem::path run_path,
                    bool replace)
    : context(device),
      dataset(std::move(data)),
      options((validate(train_options), train_options)),
      run(std::move(run_path)),
      overwrite(replace),
      train_views(dataset.indices(Split::kTrain)),
      test_views(dataset.indices(Split::kTest)),
      train_cameras(cameras_of(dataset, train_views)),
      extent(scene_extent(train_cameras)),
      cut_out(dataset.alpha_is_background),
      fingerprint(dataset_fingerprint(dataset)),
      background(background_color(options, cut_out)),
      tracer(device,
             trace_options_of(options, background),
             load_mirrors(options.mirrors, options.mirror_bounces)),
      loss(device, options.pixel_loss, static_cast<float>(options.ssim_weight)),
      adam(device, adam_options_of(options)),
      density(device, options, extent, train_views.size()),
      footprint(device, train_cameras, options.footprint),
      guard(device),
      targets(device,
              views_of(dataset, train_views),
              static_cast<std::size_t>(options.image_budget) * kMiB,
              host_image_budget(options, train_cameras)),
      order(options.seed, train_views.size()) {
  if (options.exposure) exposure.emplace(device, train_views.size());
  if (train_views.empty()) {
    const bool held_out = options.test_every == 1 && !test_views.empty();
    throw UsageError(fmt::format(
        "The data set {} has no training views: {}", dataset.root.string(),
        held_out ? "--test-every 1 holds all of them out" : "its files name none to train on"));
  }
}

const std::vector<SmallPhoto>& Trainer::Impl::photos() {
  if (small_photos.empty()) small_photos = load_small_photos(dataset, train_views, kSmallPhoto);
  return small_photos;
}

// What shows through where no Gaussian is. No photo says what lies there, and of all colours the
// typical one is the least wrong. The run's configuration names it from then on.
void Trainer::Impl::choose_background() {
  if (options.background != "auto" || cut_out) return;
  std::vector<std::size_t> some;
  const std::size_t count = std::min(kMeanPhotos, train_views.size());
  for (std::size_t i = 0; i < count; ++i)
    some.push_back(train_views[i * train_views.size() / count]);
  const std::array<float, 3> color = typical_color(
      small_photos.empty() ? load_small_photos(dataset, some, kSmallPhoto) : small_photos);
  options.background = fmt::format("{:.4f},{:.4f},{:.4f}", color[0], color[1], color[2]);
  background = background_color(options, cut_out);
}

// The most Gaussians of this run.
std::size_t Trainer::Impl::limit() {
  if (options.max_gaussians > 0) return static_cast<std::size_t>(options.max_gaussians);
  double pixels = 0;
  for (const Camera& camera : train_cameras) pixels += static_cast<double>(pixels_of(camera));
  pixels /= static_cast<double>(train_cameras.size());
  if (cut_out) pixels *= opaque_share(photos());
  const MemoryDemand demand{fitted_limit(pixels, options.iterations), largest_photo(),
                            train_views.size(), ray_views(), tracer.triangles()};
  return std::max<std::size_t>(1, gaussians_that_fit(options, demand, context.device()));
}

std::size_t Trainer::Impl::largest_photo() const {
  std::size_t pixels = 0;
  for (const Camera& camera : train_cameras) pixels = std::max(pixels, pixels_of(camera));
  return pixels;
}

std::size_t Trainer::Impl::ray_views() const {
  return static_cast<std::size_t>(
      std::count_if(train_cameras.begin(), train_cameras.end(),
                    [this](const Camera& camera) { return tracer.by_rays(camera); }));
}

// Makes the first model, unless resume() has brought one.
void Trainer::Impl::start() {
  if (!continues && !overwrite) check_no_run(run.path());
  const std::size_t most = limit();
  density.set_limit(most);
  if (started) {
    if (overwrite) run.remove_after(continues ? iteration : 0);
    run.begin_metrics(iteration);
  } else {
    Gaussians model = initial_model(
        dataset, train_cameras, [this]() -> const auto& { return photos(); }, most, options);
    if (model.size() == 0) throw UsageError("The first model has no Gaussians: use --init random");
    const std::vector<std::uint32_t> along_curve = morton_order(model.means);
    gaussians =
        DeviceGaussians::upload(context, gathered(model, along_curve), options.scale_activation);
    adam.initialize(gaussians.count, gaussians.sh_degree);
    footprint.update(gaussians);
    choose_background();
    if (overwrite) run.remove_after(0);
    run.begin_metrics(0);
    started = true;
    whole = true;
  }
  small_photos = {};
  const bool grows = density.accumulates_at(iteration);
  check_memory(options,
               {grows ? std::max(gaussians.count, most) : gaussians.count, largest_photo(),
                train_views.size(), ray_views(), tracer.triangles()},
               context.device());
  if (const std::size_t by_rays = ray_views(); by_rays > 0) {
    spdlog::info("{} of {} training views are traced ray by ray: {}", by_rays, train_cameras.size(),
                 !options.mirrors.empty() ? "there are mirrors in the scene"
                 : options.traversal == Traversal::kBvh
                     ? "traversal is bvh"
                     : "as tuned for the device, or their cameras have no tiles");
  }
  run.write_config(options);
  run.write_cameras(train_cameras);
  // From here on what is in the folder is of this run.
  continues = true;
  overwrite = false;
}

// One view: forward, loss, backward, statistics, Adam; nothing is waited for.
void Trainer::Impl::step() {
  const std::size_t view = order.at(iteration);
  targets.prefetch(order.upcoming(kReadAhead - 1));
  const int divisor = resolution_divisor(options, iteration);
  const Camera& full = train_cameras[view];
  const Camera camera = divisor > 1 ? downscaled(full, divisor) : full;
  const std::array<float, 3> behind = step_background(options, cut_out, background, iteration);
  gaussians.active_sh_degree = active_sh_degree(options, iteration);
  tracer.set_background(behind);
  tracer.forward(gaussians, camera, true);
  const Buffer<float>& shown =
      exposure ? exposure->apply(tracer.image(), view, camera.width, camera.height)
               : tracer.image();
  loss.evaluate(shown, targets.get(view, camera.width, camera.height), cut_out, behind,
                camera.width, camera.height, image_gradient);
  const ImageLoss::Partials partials = loss.partials();
  guard.check_loss(partials.pixel, partials.ssim, partials.tiles);
  if (exposure) {
    whole = false;
    exposure->step(tracer.image(), image_gradient, view, camera.width, camera.height,
                   learning_rate(options.exposure_lr, options, iteration), guard.mark());
  }
  tracer.backward(gaussians, image_gradient, gradients);
  whole = false;
  if (density.accumulates_at(iteration)) density.accumulate(gaussians, gradients, &guard.mark());
  adam.step(gaussians, gradients, adam_rates_of(options, extent, iteration), &guard.mark());
  footprint.apply(gaussians, guard.mark());
  guard.close(adam.refused(), gaussians.count);
  traced_rays += pixels_of(camera);
  ++iteration;
  whole = true;
  stepped = true;
}

// Stops the run when the guard has stopped the steps; waits for the device.
void Trainer::Impl::check_guard() {
  const StepGuard::Counts counts = guard.counts();
  if (counts.stopped) {
    write_dump();
    throw Error(
        ErrorCode::kRuntime,
        fmt::format("The loss or the gradients were not finite in {} steps in a row by iteration "
                    "{}; the model before them, the last picture and its camera are in {}: lower "
                    "the learning rates, or look for photos and points that are not finite",
                    StepGuard::kLimit, iteration, (run.path() / "dump").string()));
  }
  if (counts.bad_steps > reported_bad_steps) {
    spdlog::warn("iteration {}: {} steps so far had a loss or gradients that were not finite",
                 iteration, counts.bad_steps);
    reported_bad_steps = counts.bad_steps;
  }
}

// Stops the run at a fault that no step may leave behind.
void Trainer::Impl::validate_model() {
  if (!validator) {
    validator.emplace(context, trace_options_of(options, background));
  }
  const std::string fault = validator->find_fault(gaussians, adam);
  if (fault.empty()) return;
  throw Error(ErrorCode::kRuntime,
              fmt::format("The model is damaged after iteration {}: {}; resume from an earlier "
                          "checkpoint, with --validate-every 1 to find the step, or on another "
                          "--device",
                          iteration, fault));
}

// What somebody who looks for the cause needs.
void Trainer::Impl::write_dump() {
  const std::filesystem::path folder = run.path() / "dump";
  write_image(folder / "picture.exr", tracer.download_image(), {}, ColorSpace::kDisplay);
  const Camera& camera = train_cameras[order.at(iteration - 1)];
  nlohmann::json rotation = nlohmann::json::array();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) rotation.push_back(camera.rotation[column][row]);
  }
  const nlohmann::json json{
      {"iteration", iteration},
      {"loss", loss.value().total},
      {"view", camera.name},
      {"width", camera.width},
      {"height", camera.height},
      {"world_to_camera", rotation},
      {"translation", {camera.translation[0], camera.translation[1], camera.translation[2]}},
      {"refused_gradients", adam.skipped()}};
  write_text_file(folder / "step.json", json.dump(2) + "\n");
  write_checkpoint(folder / "state.rsck", state());
}

// Waits for the device and reports the step just done.
void Trainer::Impl::report(Progress& progress) {
  const ImageLoss::Value value = loss.value();
  check_guard();
  last_loss = value.total;
  const double psnr = std::min(value.psnr, kMostPsnr);
  note_rise(psnr);
  const double seconds = training.seconds();
  const double elapsed = seconds - row_seconds;
  run.append({iteration, seconds, value.total, psnr, gaussians.count,
              elapsed > 0 ? static_cast<double>(iteration - row_iteration) / elapsed : 0.0});
  row_iteration = iteration;
  row_seconds = seconds;
  progress.update(iteration, fmt::format("loss {:.4f}, PSNR {:.2f} of this view, {} Gaussians{}",
                                         value.total, psnr, gaussians.count, capped_share()));
}

// What the progress line says of rays that the cap on hits cut off; the first time that they are
// many, a warning does too.
std::string Trainer::Impl::capped_share() {
  const std::uint64_t capped = capped_rays();
  if (capped == 0) return "";
  const double share = static_cast<double>(capped) / static_cast<double>(traced_rays);
  if (share >= kManyCapped && !cap_reported) {
    cap_reported = true;
    warn_of_capped_rays();
  }
  return fmt::format(", {:.2g} % of rays capped", 100.0 * share);
}

void Trainer::Impl::warn_of_capped_rays() const {
  spdlog::warn(
      "iteration {}: {} of {} rays traced so far stopped at --max-hits {} and miss what lies "
      "behind: raise it",
      iteration, capped_rays(), traced_rays, options.max_hits);
}

// Views differ in what they can reach, so a view is compared with itself.
void Trainer::Impl::note_rise(double psnr) {
  const std::pair view(order.at(iteration - 1), resolution_divisor(options, iteration - 1));
  const auto [first, is_new] = first_psnr.try_emplace(view, psnr);
  if (is_new) return;
  psnr_rise = std::max(psnr_rise.value_or(psnr - first->second), psnr - first->second);
  ++views_seen_again;
}

// Of a run whose pictures never came nearer to the photos.
void Trainer::Impl::warn_of_no_progress() const {
  if (views_seen_again < kViewsToJudge || *psnr_rise > kLeastRise) return;
  spdlog::warn(
      "the model learned nothing: the PSNR of no training view rose by more than {} dB; see "
      "whether cameras, points and photos belong together ('raysplats info {}')",
      kLeastRise, dataset.root.string());
}

// What happens between this step and the next one: density control.
void Trainer::Impl::control_density() {
  const bool refines = density.refines_at(iteration);
  const bool resets = density.resets_at(iteration);
  if (!refines && !resets) return;
  check_guard();
  whole = false;
  if (refines) {
    const DensityPlan plan = density.refine(gaussians, iteration);
    if (plan.changes()) {
      const std::vector<std::uint32_t> source = plan.state_source();
      Buffer<std::uint32_t> device_source(context, source.size(), "state sources");
      device_source.upload(source);
      adam.remap(device_source, gaussians.count);
    }
    footprint.update(gaussians);
    spdlog::debug("iteration {}: {} cloned, {} split, {} pruned, {} refused, {} Gaussians",
                  iteration, plan.cloned, plan.split, plan.pruned, plan.refused, gaussians.count);
  }
  if (resets) {
    density.reset_opacities(gaussians);
    adam.reset(ParameterGroup::kOpacities);
  }
  whole = true;
}

// Traces the test views; the time counts as evaluation, not as training.
void Trainer::Impl::evaluate_views(bool last) {
  if (test_views.empty()) return;
  evaluating.start();
  tracer.set_background(background);
  const auto render = [this](const Camera& camera) {
    tracer.forward(gaussians, camera);
    return tracer.download_image();
  };
  EvaluationOptions choice;
  choice.max_views = last ? 0 : static_cast<std::size_t>(options.eval_views);
  choice.max_pictures = static_cast<std::size_t>(options.eval_renders);
  const EvaluationReport report = raysplats::evaluate(render, dataset, Split::kTest, background,
                                                      run.evaluation_folder(iteration), choice);
  run.record({iteration, training.seconds(), report.mean.psnr, report.mean.ssim,
              report.images.size(), gaussians.count, report.mean.psnr_corrected,
              report.mean.psnr_all});
  write_metrics(false);
  evaluating.stop();
  spdlog::info("iteration {}: PSNR {:.2f} dB, SSIM {:.4f} over {} test views after {} of training",
               iteration, report.mean.psnr, report.mean.ssim, report.images.size(),
               format_duration(training.seconds()));
}

void Trainer::Impl::save_model() {
  run.write_model(gaussians.download(), trace_options_of(options, background), iteration);
  if (exposure) run.write_exposures(train_cameras, exposure->state().deltas);
}

Checkpoint Trainer::Impl::state() {
  Checkpoint checkpoint;
  checkpoint.iteration = iteration;
  checkpoint.seed = options.seed;
  checkpoint.scene_extent = extent;
  checkpoint.dataset = fingerprint;
  checkpoint.config = to_toml(options);
  const StepGuard::Counts counts = guard.counts();
  checkpoint.bad_steps = counts.bad_steps;
  checkpoint.bad_steps_in_a_row = counts.in_a_row;
  checkpoint.traced_rays = traced_rays;
  checkpoint.capped_rays = capped_rays();
  store_state(gaussians, adam, density, checkpoint);
  if (footprint.lows().size() > 0) checkpoint.sections["footprint"] = footprint.lows().download();
  if (exposure) {
    Exposure::State colors = exposure->state();
    checkpoint.sections["exposure"] = std::move(colors.deltas);
    checkpoint.sections["exposure.first"] = std::move(colors.first);
    checkpoint.sections["exposure.second"] = std::move(colors.second);
    checkpoint.sections["exposure.steps"] = std::move(colors.steps);
  }
  return checkpoint;
}

void Trainer::Impl::save_checkpoint() {
  write_checkpoint(checkpoint_path(run.path(), iteration), state());
  saved = iteration;
  remove_old_checkpoints(run.path(), options.keep_checkpoints, iteration);
}

// After a failure: saves the last whole state, if the device still gives it. Returns what the user
// can do then.
std::string Trainer::Impl::rescue() {
  const auto turn = context.lock();
  if (whole && saved != iteration) {
    try {
      context.finish();
      write_checkpoint(checkpoint_path(run.path(), iteration), state());
      saved = iteration;
    } catch (const std::exception& error) {
      spdlog::warn("the state of iteration {} cannot be saved: {}", iteration, error.what());
    }
  }
  if (saved < 0) return "nothing was saved yet";
  return fmt::format("iteration {} is saved: continue with --resume {}", saved,
                     run.path().string());
}

// The photos as the run saw them: another size or choice of them is another run.
void Trainer::Impl::check_data_options(const Checkpoint& checkpoint) const {
  if (checkpoint.config.empty()) return;
  const TrainOptions before = parse_train_config(checkpoint.config);
  const auto differs = [&](const char* option, const auto& was, const auto& is) {
    if (was == is) return;
    throw UsageError(fmt::format(
        "The checkpoint of iteration {} was made with '{}' = {}, not {}: resume with the value of "
        "the run, or start a new one with --init",
        checkpoint.iteration, option, was, is));
  };
  differs("downscale", before.downscale, options.downscale);
  differs("test-every", before.test_every, options.test_every);
  differs("undistort", before.undistort, options.undistort);
  differs("exposure", before.exposure, options.exposure);
  const auto cuts = [](const TrainOptions& o) { return o.masks == MaskUse::kCutout; };
  differs("masks = cutout", cuts(before), cuts(options));
}

void Trainer::Impl::resume(const std::filesystem::path& source) {
  const bool own = source == "latest";
  const std::filesystem::path place = own ? run.path() : source;
  if (own && list_checkpoints(place).empty()) {
    spdlog::info("{} holds no checkpoint yet: the run starts anew", place.string());
    continues = true;
    return;
  }
  const FolderUse use(*this);
  const Checkpoint checkpoint = load_latest_checkpoint(place);
  if (checkpoint.seed != options.seed) {
    throw UsageError(fmt::format(
        "The checkpoint was made with seed {}, not {}: resume with the configuration of the run",
        checkpoint.seed, options.seed));
  }
  if (!checkpoint.dataset.empty() && checkpoint.dataset != fingerprint) {
    throw UsageError(
        fmt::format("The checkpoint of iteration {} was made with other data than {}: resume with "
                    "the photos and cameras of the run, or start a new one with --init",
                    checkpoint.iteration, dataset.root.string()));
  }
  check_data_options(checkpoint);
  if (checkpoint.iteration > options.iterations) {
    throw UsageError(fmt::format(
        "The run is at iteration {} already, beyond --iterations {}: raise them, or resume from an "
        "earlier checkpoint",
        checkpoint.iteration, options.iterations));
  }
  const bool file = !std::filesystem::is_directory(place);
  const std::filesystem::path folder = file ? place.parent_path().parent_path() : place;
  std::error_code error;
  continues = std::filesystem::equivalent(folder.empty() ? "." : folder, run.path(), error);
  const std::vector<std::filesystem::path> files = list_checkpoints(run.path());
  if (continues && file && !overwrite && !files.empty() &&
      files.back() > checkpoint_path(run.path(), checkpoint.iteration)) {
    throw UsageError(fmt::format(
        "The run in {} has gone on to {} after this checkpoint: go on from there with --resume "
        "latest, choose another folder, or drop what came after iteration {} by --overwrite",
        run.path().string(), files.back().filename().string(), checkpoint.iteration));
  }
  restore_state(context, checkpoint, options, gaussians, adam, density);
  const auto lows = checkpoint.sections.find("footprint");
  if (lows != checkpoint.sections.end() && lows->second.size() == gaussians.count) {
    footprint.restore(lows->second);
  } else {
    footprint.update(gaussians);  // of a version that had none
  }
  if (exposure) {
    const auto part = [&](const std::string& name) {
      const auto found = checkpoint.sections.find(name);
      return found == checkpoint.sections.end() ? std::vector<float>() : found->second;
    };
    exposure->restore({part("exposure"), part("exposure.first"), part("exposure.second"),
                       part("exposure.steps")});
  }
  // What the run began with, black in those of older versions.
  if (options.background == "auto" && !checkpoint.config.empty())
    options.background = parse_train_config(checkpoint.config).background;
  background = background_color(options, cut_out);
  guard.restore({checkpoint.bad_steps_in_a_row, checkpoint.bad_steps, false});
  reported_bad_steps = checkpoint.bad_steps;
  traced_rays = checkpoint.traced_rays;
  capped_before = checkpoint.capped_rays;
  iteration = checkpoint.iteration;
  training.set(recorded_seconds(folder, iteration));
  started = true;
  whole = true;
}

void Trainer::Impl::write_metrics(bool complete) {
  run.write_metrics({{"complete", complete},
                     {"iteration", iteration},
                     {"iterations", options.iterations},
                     {"gaussians", gaussians.count},
                     {"loss", last_loss},
                     {"training_seconds", training.seconds()},
                     {"evaluation_seconds", evaluating.seconds()},
                     {"kernel_build_seconds", context.build_seconds()},
                     {"traced_rays", traced_rays},
                     {"capped_rays", capped_rays()},
                     {"psnr_rise", psnr_rise ? nlohmann::json(*psnr_rise) : nullptr},
                     {"skipped_updates", adam.skipped()},
                     {"bad_steps", guard.counts().bad_steps},
                     {"peak_device_bytes", context.peak_allocated_bytes()},
                     {"device", context.device().name}});
}

// Up to `until` completed iterations; with `scheduled` also the evaluations and files of the
// options.
void Trainer::Impl::run_iterations(std::int64_t until,
                                   bool scheduled,
                                   Progress& progress,
                                   const std::function<bool()>& interrupted) {
  const auto pause = [&](const auto& work) {
    context.finish();
    training.stop();
    progress.suspend();
    work();
    progress.resume();
    training.start();
  };
  bool stop = false;
  while (iteration < until && !stop) {
    const auto turn = context.lock();
    step();
    const bool last = iteration == options.iterations;
    if (last || every(options.log_every, iteration)) report(progress);
    if (every(options.validate_every, iteration)) pause([this] { validate_model(); });
    if (callback) {
      const auto hear = callback;  // it may be replaced meanwhile
      try {
        pause([&] { hear({iteration, options.iterations, gaussians.count}); });
      } catch (...) {
        if (!last) control_density();  // what is saved then has this iteration complete
        throw;
      }
    }
    // Asked once: a signal that comes later is seen after the next step.
    stop = interrupted() || stop_asked;
    const bool evaluates = last || every(options.eval_every, iteration) ||
                           contains(options.eval_at, options.iterations, iteration);
    const bool saves = stop || last || contains(options.save_at, options.iterations, iteration);
    // Before density control, as in 3DGS: fresh clones and children have not settled yet.
    if (scheduled && saves) pause([this] { save_model(); });
    if (scheduled && evaluates && (last || !stop)) pause([this, last] { evaluate_views(last); });
    if (!last) control_density();
    const bool asked = save_asked.exchange(false);
    if (asked && !(scheduled && saves)) pause([this] { save_model(); });
    if (asked || (scheduled && (stop || last || every(options.checkpoint_every, iteration))))
      pause([this] { save_checkpoint(); });
  }
  context.finish();
}

// A run that is resumed where it ends: its results may not be in this folder.
void Trainer::Impl::finish_resumed() {
  if (run.has_model(iteration)) return;
  save_model();
  evaluate_views(true);
  save_checkpoint();
}

// Runs them with the folder locked. What fails is saved as far as it goes.
void Trainer::Impl::advance(std::int64_t until,
                            bool scheduled,
                            bool show_progress,
                            const std::function<bool()>& interrupted) {
  Progress progress("Training", options.iterations, iteration, show_progress ? stderr : nullptr);
  row_iteration = iteration;
  row_seconds = training.seconds();
  training.start();
  try {
    if (scheduled && iteration == options.iterations) {
      const auto turn = context.lock();
      finish_resumed();
    }
    run_iterations(until, scheduled, progress, interrupted);
  } catch (const Error& error) {
    training.stop();
    if (error.code() == ErrorCode::kRuntime) throw;  // the model itself is at fault
    throw_with(error, rescue());
  } catch (const std::bad_alloc&) {
    training.stop();
    throw_with(ResourceError("The host has no memory left: use smaller images (--downscale) or a "
                             "smaller --image-budget"),
               rescue());
  } catch (...) {  // of a callback
    training.stop();
    spdlog::warn("a callback failed after iteration {}: {}", iteration, rescue());
    throw;
  }
  training.stop();
  progress.finish();
}

TrainSummary Trainer::Impl::train(bool show_progress) {
  const Busy busy(*this);
  const InterruptGuard interrupt;
  const FolderUse folder(*this);
  {
    const auto turn = context.lock();
    start();
  }
  advance(options.iterations, true, show_progress, [&] { return interrupt.requested(); });
  write_metrics(iteration == options.iterations);
  if (capped_rays() > 0) warn_of_capped_rays();
  if (iteration == options.iterations) warn_of_no_progress();
  if (const auto best = better_before(run.evaluations())) {
    spdlog::warn(
        "the last PSNR of the test views, {:.2f} dB, is below that of iteration {}, {:.2f} dB: the "
        "run learns its photos by heart or its rates are too high",
        run.evaluations().back().psnr, best->iteration, best->psnr);
  }
  if (iteration < options.iterations && !stop_asked) {
    throw Error(
        ErrorCode::kInterrupted,
        fmt::format("Interrupted at iteration {}; everything is saved: continue with --resume {}",
                    iteration, run.path().string()));
  }
  TrainSummary summary;
  summary.iterations = iteration;
  summary.gaussians = gaussians.count;
  summary.loss = last_loss;
  summary.training_seconds = training.seconds();
  summary.evaluation_seconds = evaluating.seconds();
  summary.kernel_build_seconds = context.build_seconds();
  summary.evaluations = run.evaluations();
  return summary;
}

bool Trainer::Impl::train_some(std::int64_t count) {
  if (count < 1) {
    throw UsageError(
        fmt::format("Trainer::step() cannot make {} iterations: ask for 1 or more", count));
  }
  const Busy busy(*this);
  prepare();
  const std::int64_t left = std::max<std::int64_t>(options.iterations - iteration, 0);
  advance(iteration + std::min(count, left), false, false, [] { return false; });
  return iteration < options.iterations;
}

// For steps of the caller's own: the folder stays locked until the trainer goes.
void Trainer::Impl::prepare() {
  if (prepared) return;
  const auto turn = context.lock();
  if (!folder_lock) folder_lock.emplace(run.lock());
  start();
  prepared = true;
}

Trainer::Trainer(Context& context,
                 Dataset dataset,
                 const TrainOptions& options,
                 std::filesystem::path run_folder,
                 bool overwrite)
    : impl_(std::make_unique<Impl>(
          context, std::move(dataset), options, std::move(run_folder), overwrite)) {}
Trainer::~Trainer() = default;

void Trainer::resume(const std::filesystem::path& source) {
  const auto turn = impl_->context.lock();
  impl_->resume(source);
}

TrainSummary Trainer::run(bool show_progress) { return impl_->train(show_progress); }

bool Trainer::step(std::int64_t count) { return impl_->train_some(count); }

void Trainer::on_step(std::function<void(const TrainProgress&)> callback) {
  const auto turn = impl_->context.lock();
  impl_->callback = std::move(callback);
}

void Trainer::stop() { impl_->stop_asked = true; }

EvaluationRow Trainer::evaluate() {
  Impl& self = *impl_;
  const auto turn = self.context.lock();
  if (self.test_views.empty()) {
    throw UsageError(fmt::format("The data set {} has no test views: set TrainOptions::test_every",
                                 self.dataset.root.string()));
  }
  if (!self.busy) self.prepare();
  self.evaluate_views(true);
  return self.run.evaluations().back();
}

void Trainer::save() {
  Impl& self = *impl_;
  if (self.busy) {
    self.save_asked = true;
    return;
  }
  const auto turn = self.context.lock();
  self.prepare();
  self.context.finish();
  self.save_model();
  self.save_checkpoint();
  self.write_metrics(self.iteration == self.options.iterations);
}

TrainLoss Trainer::loss() {
  Impl& self = *impl_;
  const auto turn = self.context.lock();
  if (!self.stepped) throw UsageError("There is no loss before the first step");
  const ImageLoss::Value value = self.loss.value();
  return {value.total, value.psnr};
}

Gaussians Trainer::model() const {
  const auto turn = impl_->context.lock();
  return impl_->started ? impl_->gaussians.download() : Gaussians();
}

const DeviceGaussians& Trainer::gaussians() const { return impl_->gaussians; }
std::int64_t Trainer::iteration() const { return impl_->iteration; }

}  // namespace raysplats
