// SPDX-License-Identifier: Apache-2.0
#include "train/trainer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "base/interrupt.hpp"
#include "base/progress.hpp"
#include "core/morton_order.hpp"
#include "eval/evaluator.hpp"
#include "raysplats/error.hpp"
#include "train/adam.hpp"
#include "train/checkpoint.hpp"
#include "train/density_control.hpp"
#include "train/image_loss.hpp"
#include "train/initialization.hpp"
#include "train/memory_estimate.hpp"
#include "train/run_state.hpp"
#include "train/schedule.hpp"
#include "train/step_tracer.hpp"
#include "train/target_cache.hpp"
#include "train/train_config.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
constexpr std::size_t kReadAhead = 8;  // photos decoded ahead of their turn
constexpr double kRecentViews = 20.0;  // logged views that the shown PSNR averages over

// A clock that can be stopped.
class Stopwatch {
 public:
  void start() { begun_ = std::chrono::steady_clock::now(); }
  void stop() { seconds_ = seconds(), begun_.reset(); }
  void set(double seconds) { seconds_ = seconds; }
  double seconds() const {
    if (!begun_) return seconds_;
    return seconds_ +
           std::chrono::duration<double>(std::chrono::steady_clock::now() - *begun_).count();
  }

 private:
  double seconds_ = 0;
  std::optional<std::chrono::steady_clock::time_point> begun_;
};

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

std::vector<Camera> cameras_of(const Dataset& dataset, const std::vector<std::size_t>& views) {
  std::vector<Camera> cameras;
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
  trace.background = background;
  trace.packet_width = options.packet_width;
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

bool contains(const std::vector<std::int64_t>& list, std::int64_t value) {
  return std::find(list.begin(), list.end(), value) != list.end();
}

bool every(std::int64_t period, std::int64_t iteration) {
  return period > 0 && iteration % period == 0;
}

}  // namespace

struct Trainer::Impl {
  Impl(Context& device,
       Dataset data,
       const TrainOptions& train_options,
       std::filesystem::path run_path);

  void start();
  void step();
  void report(Progress& progress);
  void control_density();
  void evaluate_views(bool last);
  void save_model();
  void save_checkpoint();
  void write_metrics(bool complete);
  TrainSummary train(bool show_progress);

  Context& context;
  Dataset dataset;
  TrainOptions options;
  RunFolder run;
  std::vector<std::size_t> train_views;
  std::vector<std::size_t> test_views;
  std::vector<Camera> train_cameras;
  double extent;
  bool cut_out;
  std::array<float, 3> background;
  StepTracer tracer;
  ImageLoss loss;
  Adam adam;
  DensityControl density;
  TargetCache targets;
  ViewOrder order;

  DeviceGaussians gaussians;
  GaussianGradients gradients;
  Buffer<float> image_gradient;
  std::int64_t iteration = 0;  // completed
  bool started = false;
  Stopwatch training;
  Stopwatch evaluating;
  double last_loss = 0;
  std::optional<double> recent_psnr;
  std::int64_t row_iteration = 0;
  double row_seconds = 0;
};

Trainer::Impl::Impl(Context& device,
                    Dataset data,
                    const TrainOptions& train_options,
                    std::filesystem::path run_path)
    : context(device),
      dataset(std::move(data)),
      options((validate(train_options), train_options)),
      run(std::move(run_path)),
      train_views(dataset.indices(Split::kTrain)),
      test_views(dataset.indices(Split::kTest)),
      train_cameras(cameras_of(dataset, train_views)),
      extent(scene_extent(train_cameras)),
      cut_out(dataset.alpha_is_background),
      background(background_color(options, cut_out)),
      tracer(device,
             trace_options_of(options, background),
             load_mirrors(options.mirrors, options.mirror_bounces)),
      loss(device, options.pixel_loss, static_cast<float>(options.ssim_weight)),
      adam(device, adam_options_of(options)),
      density(device, options, extent),
      targets(device,
              views_of(dataset, train_views),
              static_cast<std::size_t>(options.image_budget) * kMiB,
              host_image_budget(options, train_cameras)),
      order(options.seed, train_views.size()) {
  if (train_views.empty()) {
    throw UsageError(fmt::format("The data set {} has no training views: raise --test-every",
                                 dataset.root.string()));
  }
}

// Makes the first model, unless resume() has brought one.
void Trainer::Impl::start() {
  if (!started) {
    Gaussians model = initial_model(dataset, train_cameras, options);
    if (model.size() == 0) throw UsageError("The first model has no Gaussians: use --init random");
    const std::vector<std::uint32_t> along_curve = morton_order(model.means);
    gaussians =
        DeviceGaussians::upload(context, gathered(model, along_curve), options.scale_activation);
    adam.initialize(gaussians.count, gaussians.sh_degree);
    run.begin_metrics(0);
    started = true;
  }
  std::size_t pixels = 0;
  for (const Camera& camera : train_cameras) pixels = std::max(pixels, pixels_of(camera));
  const bool grows =
      options.densify_until >= options.densify_from && options.densify_until > iteration;
  const std::size_t most =
      grows ? std::max(gaussians.count, static_cast<std::size_t>(options.max_gaussians))
            : gaussians.count;
  check_memory(estimate_memory(options, most, pixels, train_views.size()), context.device());
  const auto by_rays = std::count_if(train_cameras.begin(), train_cameras.end(),
                                     [this](const Camera& c) { return tracer.by_rays(c); });
  if (by_rays > 0) {
    spdlog::info("{} of {} training views are traced ray by ray: {}", by_rays, train_cameras.size(),
                 options.mirrors.empty() ? "their cameras are no pinholes"
                                         : "there are mirrors in the scene");
  }
  run.write_config(options);
  run.write_cameras(train_cameras);
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
  tracer.update();
  tracer.forward(gaussians, camera, true);
  loss.evaluate(tracer.image(), targets.get(view, camera.width, camera.height), cut_out, behind,
                camera.width, camera.height, image_gradient);
  tracer.backward(gaussians, image_gradient, gradients);
  if (iteration < options.densify_until) density.accumulate(gaussians, gradients);
  adam.step(gaussians, gradients, adam_rates_of(options, extent, iteration));
  ++iteration;
}

// Waits for the device and reports the step just done.
void Trainer::Impl::report(Progress& progress) {
  const ImageLoss::Value value = loss.value();
  if (!std::isfinite(value.total)) {
    throw Error(ErrorCode::kRuntime, fmt::format("The loss is {} at iteration {}: lower the "
                                                 "learning rates, or look for photos and points "
                                                 "that are not finite",
                                                 value.total, iteration));
  }
  last_loss = value.total;
  const double psnr = std::min(value.psnr, 100.0);
  recent_psnr = recent_psnr ? *recent_psnr + (psnr - *recent_psnr) / kRecentViews : psnr;
  const double seconds = training.seconds();
  const double elapsed = seconds - row_seconds;
  run.append({iteration, seconds, value.total, psnr, gaussians.count,
              elapsed > 0 ? static_cast<double>(iteration - row_iteration) / elapsed : 0.0});
  row_iteration = iteration;
  row_seconds = seconds;
  progress.update(iteration, fmt::format("loss {:.4f}, PSNR {:.2f}, {} Gaussians", value.total,
                                         *recent_psnr, gaussians.count));
}

// What happens between this step and the next one: density control.
void Trainer::Impl::control_density() {
  if (density.refines_at(iteration)) {
    const DensityPlan plan = density.refine(gaussians, iteration);
    if (plan.changes()) {
      const std::vector<std::uint32_t> source = plan.state_source();
      Buffer<std::uint32_t> device_source(context, source.size(), "state sources");
      device_source.upload(source);
      adam.remap(device_source, gaussians.count);
    }
    spdlog::debug("iteration {}: {} cloned, {} split, {} pruned, {} refused, {} Gaussians",
                  iteration, plan.cloned, plan.split, plan.pruned, plan.refused, gaussians.count);
  }
  if (density.resets_at(iteration)) {
    density.reset_opacities(gaussians);
    adam.reset(ParameterGroup::kOpacities);
  }
}

// Traces the test views; the time counts as evaluation, not as training.
void Trainer::Impl::evaluate_views(bool last) {
  if (test_views.empty()) return;
  evaluating.start();
  tracer.set_background(background);
  tracer.update();
  const auto render = [this](const Camera& camera) {
    tracer.forward(gaussians, camera);
    return tracer.download_image();
  };
  EvaluationOptions choice;
  choice.max_views = last ? 0 : static_cast<std::size_t>(options.eval_views);
  choice.max_pictures = static_cast<std::size_t>(options.eval_renders);
  const EvaluationReport report =
      evaluate(render, dataset, Split::kTest, background, run.evaluation_folder(iteration), choice);
  run.record({iteration, training.seconds(), report.mean.psnr, report.mean.ssim,
              report.images.size(), gaussians.count});
  write_metrics(false);
  evaluating.stop();
  spdlog::info("iteration {}: PSNR {:.2f} dB, SSIM {:.4f} over {} test views after {} of training",
               iteration, report.mean.psnr, report.mean.ssim, report.images.size(),
               format_duration(training.seconds()));
}

void Trainer::Impl::save_model() { run.write_model(gaussians.download(), iteration); }

void Trainer::Impl::save_checkpoint() {
  Checkpoint checkpoint;
  checkpoint.iteration = iteration;
  checkpoint.seed = options.seed;
  checkpoint.scene_extent = extent;
  checkpoint.training_seconds = training.seconds();
  checkpoint.config = to_toml(options);
  store_state(gaussians, adam, density, checkpoint);
  write_checkpoint(checkpoint_path(run.path(), iteration), checkpoint);
  remove_old_checkpoints(run.path(), options.keep_checkpoints);
}

void Trainer::Impl::write_metrics(bool complete) {
  run.write_metrics({{"complete", complete},
                     {"iteration", iteration},
                     {"iterations", options.iterations},
                     {"gaussians", gaussians.count},
                     {"loss", last_loss},
                     {"training_seconds", training.seconds()},
                     {"evaluation_seconds", evaluating.seconds()},
                     {"capped_rays", tracer.capped_rays()},
                     {"skipped_updates", adam.skipped()},
                     {"peak_device_bytes", context.peak_allocated_bytes()},
                     {"device", context.device().name}});
}

TrainSummary Trainer::Impl::train(bool show_progress) {
  start();
  const InterruptGuard interrupt;
  Progress progress("Training", options.iterations, iteration, show_progress ? stderr : nullptr);
  row_iteration = iteration;
  row_seconds = training.seconds();
  training.start();
  const auto pause = [&](const auto& work) {
    context.finish();
    training.stop();
    progress.suspend();
    work();
    progress.resume();
    training.start();
  };
  bool stop = false;
  while (iteration < options.iterations && !stop) {
    step();
    const bool last = iteration == options.iterations;
    if (last || every(options.log_every, iteration)) report(progress);
    // Asked once: a signal that comes later is seen after the next step.
    stop = interrupt.requested();
    const bool evaluates =
        last || every(options.eval_every, iteration) || contains(options.eval_at, iteration);
    const bool saves = stop || last || contains(options.save_at, iteration);
    // Before density control, as in 3DGS: fresh clones and children have not settled yet.
    if (saves) pause([this] { save_model(); });
    if (evaluates && (last || !stop)) pause([this, last] { evaluate_views(last); });
    if (!last) control_density();
    if (stop || last || every(options.checkpoint_every, iteration))
      pause([this] { save_checkpoint(); });
  }
  context.finish();
  training.stop();
  progress.finish();
  write_metrics(iteration == options.iterations);
  if (iteration < options.iterations) {
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
  summary.evaluations = run.evaluations();
  return summary;
}

Trainer::Trainer(Context& context,
                 Dataset dataset,
                 const TrainOptions& options,
                 std::filesystem::path run_folder)
    : impl_(std::make_unique<Impl>(context, std::move(dataset), options, std::move(run_folder))) {}
Trainer::~Trainer() = default;

void Trainer::resume(const std::filesystem::path& source) {
  const Checkpoint checkpoint = load_latest_checkpoint(source);
  if (checkpoint.seed != impl_->options.seed) {
    throw UsageError(fmt::format(
        "The checkpoint was made with seed {}, not {}: resume with the configuration of the run",
        checkpoint.seed, impl_->options.seed));
  }
  restore_state(impl_->context, checkpoint, impl_->options, impl_->gaussians, impl_->adam,
                impl_->density);
  impl_->iteration = checkpoint.iteration;
  impl_->training.set(checkpoint.training_seconds);
  impl_->started = true;
  impl_->run.begin_metrics(checkpoint.iteration);
}

TrainSummary Trainer::run(bool show_progress) { return impl_->train(show_progress); }

const DeviceGaussians& Trainer::gaussians() const { return impl_->gaussians; }
std::int64_t Trainer::iteration() const { return impl_->iteration; }

}  // namespace raysplats
