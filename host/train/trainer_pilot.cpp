// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <thread>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "train/run_time.hpp"
#include "train/schedule.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

constexpr double kBriefRun = 60;         // seconds
constexpr double kMeasuredShare = 0.05;  // of the time of a run that timed steps may take
constexpr double kMostMeasured = 600;    // seconds of them: more steps tell nothing new
constexpr double kLongest = 1e9;         // seconds, 30 years
constexpr int kLeastSteps = 3;           // of a kind that are timed
constexpr int kViews = 6;                // that they show
constexpr double kCoarseShare = 0.2;     // of the time for steps that coarse ones take
constexpr double kFullShare = 0.5;       // and these together with those at full size
constexpr double kManyShare = 0.7;       // and with those of many Gaussians
constexpr double kMostEnlarged = 4;      // by which axes of Gaussians are made longer, or shorter
constexpr int kMostPasses = 12;          // that double the count
constexpr std::int64_t kLeastIterations = 10;
constexpr double kShortRun = 20;      // seconds of a run that is not worth long measuring
constexpr double kBriefShare = 0.02;  // of such a run that further steps take
constexpr double kFillShare = 0.5;    // of the limit that a start takes at most
constexpr std::int64_t kFewIterations = 500;
constexpr double kTellingChange = 0.03;  // of them, that users are told of

void require_end(double seconds) {
  // Written so that NaN is refused.
  if (seconds <= kLongest) return;
  throw UsageError(fmt::format("A time of {} s has no end in sight: give at most {:.0f} seconds",
                               seconds, kLongest));
}

class Timer {
 public:
  explicit Timer(const Context& context) : watch_(context) { watch_.start(); }
  double seconds() const { return watch_.seconds(); }

 private:
  Stopwatch watch_;
};

// The sizes of a run that is given so little time that steps at full size would be few.
const std::vector<ResolutionStep>& coarse_schedule() {
  static const std::vector<ResolutionStep> schedule{{4, 0.2}, {3, 0.5}, {2, 0.9}};
  return schedule;
}

double mean_pixels(const std::vector<Camera>& cameras) {
  double sum = 0;
  for (const Camera& camera : cameras) sum += static_cast<double>(pixel_count(camera));
  return sum / static_cast<double>(cameras.size());
}

// The same Gaussians, larger or smaller, so that rays meet about so many times as many of them.
DeviceGaussians enlarged(Context& context, const DeviceGaussians& gaussians, double times) {
  const double longer = std::clamp(std::sqrt(times), 1 / kMostEnlarged, kMostEnlarged);
  Gaussians model = gaussians.download();
  for (float& s : model.log_scales) s += static_cast<float>(std::log(longer));
  return DeviceGaussians::upload(context, model, gaussians.activation);
}

}  // namespace

// What a small run of the same shape told.
struct Trainer::Impl::Pilot {
  double per_work = 0;               // seconds of a unit of work
  LoadRates at_start;                // of the first steps
  LoadRates at_full_size;            // of the steps that are most like those of the end
  double trained_hits = 0;           // per pixel, at the end
  double start_seconds = 0;          // of making the first model
  double photo_seconds = 0;          // that a photo adds to the run
  double seconds = 0;                // all of it
  std::optional<double> body_share;  // of the photos' pixels, where they are cut out
  std::size_t first = 0;             // Gaussians of the start
  std::size_t most = 0;              // that it may have had
};

void Trainer::Impl::check_not_begun(const char* function) const {
  if (!started && !prepared && iteration == 0) return;
  throw UsageError(fmt::format(
      "Trainer::{}() is about a run that has not begun: call it before training and resume()",
      function));
}

// What was derived from the options when this was made, from options that have changed.
void Trainer::Impl::apply_options() {
  TrainOptions centred = options;
  centred.bounds = about_origin(options.bounds, dataset.origin);
  density.follow(centred, pass_views());
  order_views();
}

double Trainer::Impl::predicted_seconds(const Pilot& pilot,
                                        std::int64_t iterations,
                                        std::size_t most) const {
  TrainOptions shaped = options;
  shaped.iterations = iterations;
  const auto limit = static_cast<double>(most);
  const double first = std::min(static_cast<double>(pilot.first), kFillShare * limit);
  const auto photos = static_cast<double>(
      std::min(iterations * options.views_per_step, static_cast<std::int64_t>(train_views.size())));
  const RateCurve rates = expected_rates(pilot.at_start, pilot.at_full_size, pilot.trained_hits);
  return pilot.start_seconds + photos * pilot.photo_seconds +
         pilot.per_work * run_work(shaped, options.views_per_step * mean_pixels(train_cameras),
                                   rates, first, limit);
}

// Steps of a pilot, with how long they took.
struct Trainer::Impl::PilotSteps {
  Impl& impl;
  double seconds;  // for all of them
  Pilot& pilot;
  std::vector<StepSample> samples = {};
  std::size_t timed = 0;  // steps of the last kind
  double spent = 0;       // without the photos, which the run has to get as well
  double photo_seconds = 0;
  std::set<std::size_t> read = {};  // views

  StepSample step();
  LoadRates stage(double until);
};

StepSample Trainer::Impl::PilotSteps::step() {
  const int divisor = resolution_divisor(impl.options, impl.iteration);
  Camera camera;
  for (std::size_t slot = 0; slot < impl.slots.size(); ++slot) {
    if (!impl.share.holds(slot)) continue;
    const std::size_t view = impl.order.at(impl.turn_of(slot));
    camera = divisor > 1 ? downscaled(impl.train_cameras[view], divisor) : impl.train_cameras[view];
    const Timer photo(impl.context);
    impl.photo_cache.get(view, camera.width, camera.height);
    if (impl.depths) impl.depths->prepare({view, camera.width, camera.height});
    impl.context.finish();
    if (read.insert(view).second) photo_seconds += photo.seconds();
  }
  const std::uint64_t made_again = impl.made_again;
  const Timer timer(impl.context);
  impl.send_step();
  impl.finish_steps();
  const double seconds_of_step = timer.seconds();
  spent += seconds_of_step;
  const bool counts = impl.made_again == made_again;  // it had room enough
  // Its views are taken to be like the last one.
  const auto views = static_cast<double>(impl.slots.size());
  const auto work = impl.tracer.statistics();
  return {
      {views * static_cast<double>(pixel_count(camera)), static_cast<double>(impl.gaussians.count),
       static_cast<double>(sh_coefficients(impl.gaussians.active_sh_degree)),
       views * static_cast<double>(work.hits), views * static_cast<double>(work.candidates)},
      impl.ranks.broadcast_value(0, counts ? seconds_of_step : 0)};
}

// Times steps of one kind until the share `until` of the time is spent. The first step of a kind
// compiles kernels and makes buffers: it does not count. A few views come again and again: reading
// photos would slow down a CPU that trains.
LoadRates Trainer::Impl::PilotSteps::stage(double until) {
  const std::int64_t first_step = impl.iteration;
  step();
  const std::size_t begin = samples.size();
  int counted = 0;
  // The first rank's clock counts for all.
  for (int i = 0; counted < kLeastSteps || impl.ranks.broadcast_value(0, spent < until * seconds);
       ++i) {
    impl.iteration = first_step + i % kViews;
    samples.push_back(step());
    counted += samples.back().seconds > 0 ? 1 : 0;
  }
  const std::span<const StepSample> own = std::span(samples).subspan(begin);
  const LoadRates met = LoadRates::of(own);
  pilot.per_work = impl.ranks.broadcast_value(0, seconds_per_work(own));
  timed = own.size();
  return {impl.ranks.broadcast_value(0, met.hits), impl.ranks.broadcast_value(0, met.candidates)};
}

// Times steps from the start on the device: coarse ones, ones at full size, and ones with as many
// Gaussians as the run will have at its end. `run`: the seconds of the run, if they are given.
void Trainer::Impl::time_steps(double seconds, std::optional<double> run, Pilot& pilot) {
  PilotSteps steps{*this, seconds, pilot};
  iteration = 0;
  reads_ahead = false;
  const auto note = [&](const LoadRates& met) {
    pilot.at_full_size = met;
    pilot.trained_hits = trained_hits(met.hits, pilot.body_share);
  };
  pilot.at_start = steps.stage(kCoarseShare);
  note(pilot.at_start);
  const auto rough = [&](std::int64_t iterations) {
    return predicted_seconds(pilot, iterations, gaussians.count);
  };
  // Coarse steps alone tell too little of the speed: what does not grow with them is most of them.
  const double expected = run ? *run : ranks.broadcast_value(0, rough(options.iterations));
  if (!run && expected < kShortRun)
    steps.seconds = std::min(seconds, steps.spent + kBriefShare * expected);
  iteration = options.iterations / 2;
  note(steps.stage(kFullShare));
  const std::size_t most =
      most_gaussians(run ? iterations_within(*run, kLeastIterations, rough) : options.iterations);
  for (int pass = 0; pass < kMostPasses && density.accumulates_at(0) && gaussians.count < most;
       ++pass)
    apply_plan(density.split_evenly(gaussians, most));
  note(steps.stage(run ? kManyShare : 1));
  // A run by time is planned by steps that meet as many as those of its end, since what a hit costs
  // beside all else differs among devices. Where the largest overlap they may take longer than the
  // end's: a run of too few iterations goes on, one of too many ends with rates that are still
  // high.
  const bool has_time = ranks.broadcast_value(0, run && steps.spent < seconds);
  if (has_time && pilot.at_full_size.hits > 0) {
    gaussians = enlarged(context, gaussians, pilot.trained_hits / pilot.at_full_size.hits);
    pilot.at_full_size = steps.stage(1);
  }
  spdlog::debug(
      "the last {} of {} timed steps took {:.3g} us a unit of work; {:.3g} hits a pixel and {:.3g} "
      "candidates a Gaussian at first, {:.3g} and {:.3g} with {} Gaussians; a photo is read in "
      "{:.3g} ms",
      steps.timed, steps.samples.size(), 1e6 * pilot.per_work, pilot.at_start.hits,
      pilot.at_start.candidates, pilot.at_full_size.hits, pilot.at_full_size.candidates,
      gaussians.count, 1e3 * steps.photo_seconds / static_cast<double>(steps.read.size()));
  // The run reads several at a time, each rank its own.
  const std::size_t readers =
      std::min<std::size_t>(kReadAhead, std::max(1u, std::thread::hardware_concurrency()));
  pilot.photo_seconds = ranks.broadcast_value(
      0, steps.photo_seconds / static_cast<double>(steps.read.size() * readers *
                                                   static_cast<std::size_t>(ranks.size())));
}

// Everything as it was before the first step.
void Trainer::Impl::undo_pilot() {
  apply_options();
  density.restore_statistics({});
  gaussians = DeviceGaussians();
  guard.restore({});
  mean.restart(0);
  fit.forget();
  reset_exposure();
  reset_sky();
  reset_poses();
  iteration = 0;
  reads_ahead = true;
  traced_rays = 0;
  whole = stepped = pass_due = false;
}

// Begins the programs of steps that evaluate so many bands.
void Trainer::Impl::begin_programs(std::initializer_list<int> degrees) {
  DeviceGaussians form;
  form.activation = options.scale_activation;
  form.sh_degree = options.sh_degree;
  for (const int degree : degrees) {
    form.active_sh_degree = degree;
    tracer.begin_programs(form, train_cameras.front(), true, options.depth_weight > 0);
  }
  adam.begin_programs(options.sh_degree);
}

Trainer::Impl::Pilot Trainer::Impl::run_pilot(double seconds, std::optional<double> run_time) {
  if (!continues && !overwrite && ranks.leads()) check_no_run(run.path());
  const Timer timer(context);
  Pilot pilot;
  const std::size_t most = limit();
  pilot.most = most;
  check_room(0, most);
  // While the start is made: those of the steps that are timed.
  begin_programs({active_sh_degree(options, 0), active_sh_degree(options, options.iterations / 2)});
  choose_background();
  choose_color_range();
  Gaussians made = new_model(most);
  first_model = made;
  pilot.start_seconds = ranks.broadcast_value(0, timer.seconds());
  upload_first_model(most);
  pilot.first = gaussians.count;
  if (cut_out) pilot.body_share = body_share(photos(PhotoChoice::kAll));
  context.finish_builds();  // compilers would slow down the steps of a CPU
  try {
    time_steps(seconds, run_time, pilot);
  } catch (...) {
    undo_pilot();
    throw;
  }
  undo_pilot();
  first_model = std::move(made);
  pilot.seconds = ranks.broadcast_value(0, timer.seconds());
  return pilot;
}

RunEstimate Trainer::Impl::with_evaluations(RunEstimate training) const {
  if (!test_views.empty()) {
    const std::size_t some =
        options.eval_views > 0
            ? std::min(test_views.size(), static_cast<std::size_t>(options.eval_views))
            : test_views.size();
    training.evaluations = evaluation_count(options);
    training.evaluated_views = (training.evaluations - 1) * some + test_views.size();
  }
  if (!apart.empty()) {
    const std::size_t validations = validation_count(options);
    training.evaluations += validations;
    training.evaluated_views += validations * apart.size();
  }
  return training;
}

RunEstimate Trainer::Impl::estimate(double seconds) {
  check_not_begun("estimate");
  require_end(seconds);
  const Pilot pilot = run_pilot(seconds, std::nullopt);
  const std::size_t most = most_gaussians(options.iterations);
  const bool grows = density.accumulates_at(0);
  const double planned = predicted_seconds(pilot, options.iterations, grows ? most : pilot.first);
  const std::int64_t end = last_iteration(options);
  RunEstimate out;
  out.iterations = end;
  out.gaussians = grows ? most : pilot.first;
  out.seconds = planned * static_cast<double>(end) /
                static_cast<double>(std::max<std::int64_t>(options.iterations, 1));
  return with_evaluations(out);
}

RunEstimate Trainer::Impl::fit_time(double seconds) {
  check_not_begun("fit_time");
  require_end(seconds);
  if (!(seconds > 0)) {
    throw UsageError(fmt::format("A run of {} s trains nothing: give it more time", seconds));
  }
  // What finds them takes seconds.
  if (seconds < kBriefRun) options.photo_points = false;
  const Pilot pilot = run_pilot(std::min(kMeasuredShare * seconds, kMostMeasured), seconds);
  const double left = seconds - pilot.seconds;
  const auto duration = [&](std::int64_t iterations) {
    return predicted_seconds(pilot, iterations, most_gaussians(iterations));
  };
  const double least = duration(kLeastIterations);
  if (least > left) {
    throw UsageError(fmt::format(
        "A run of {:.3g} s is too short: measuring, the start and {} iterations take {:.2g} s here",
        seconds, kLeastIterations, pilot.seconds + least));
  }
  options.iterations = iterations_within(left, kLeastIterations, duration);
  if (options.iterations < kFewIterations &&
      options.resolution_schedule == TrainOptions().resolution_schedule) {
    options.resolution_schedule = coarse_schedule();
    options.iterations = iterations_within(left, kLeastIterations, duration);
  }
  options.max_gaussians = static_cast<std::int64_t>(most_gaussians(options.iterations));
  if (limit() != pilot.most) first_model.reset();
  apply_options();
  options.end_iteration = 0;
  clock.training.set(pilot.seconds);
  clock.run_seconds = seconds;
  RunEstimate out;
  out.iterations = options.iterations;
  out.gaussians = static_cast<std::size_t>(options.max_gaussians);
  out.seconds = pilot.seconds + duration(options.iterations);
  return with_evaluations(out);
}

// Keeps a run by time to its time: its last steps are alike, and once a part of them is timed the
// time that is left tells how many more there can be. What the steps do depends on the schedules
// alone, so that a run which is given this end from the beginning has the same bytes. Returns
// whether the run now has another end.
bool Trainer::Impl::fit_end_to_time() {
  if (!clock.run_seconds) return false;
  const std::int64_t from = steady_from(options);
  const std::int64_t until = timed_until(options);
  if (iteration == from) {
    finish_steps();
    clock.steady_seconds = clock.training.seconds();
    return false;
  }
  if (!clock.steady_seconds || iteration != until || iteration >= options.iterations) return false;
  finish_steps();
  const double now = clock.training.seconds();
  const double step = (now - *clock.steady_seconds) / static_cast<double>(until - from);
  const std::int64_t end =
      fitted_end({iteration, now, step}, options.iterations, *clock.run_seconds);
  options.end_iteration = ranks.broadcast_value(0, end);
  run.write_config(options);
  return true;
}

// To whoever watches, and to the user where it makes a difference.
void Trainer::Impl::tell_fitted_end() const {
  if (watcher) watcher->will_end(options.end_iteration);
  const double change =
      static_cast<double>(options.end_iteration) / static_cast<double>(options.iterations) - 1;
  spdlog::log(std::abs(change) > kTellingChange ? spdlog::level::info : spdlog::level::debug,
              "{} iterations fit the time after all, not {}", options.end_iteration,
              options.iterations);
}

}  // namespace raysplats
