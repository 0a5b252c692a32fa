// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <limits>
#include <new>

#include "train/schedule.hpp"
#include "train/trainer_impl.hpp"
#include "util/file_kind.hpp"
#include "util/interrupt.hpp"
#include "util/shell_word.hpp"

namespace raysplats {
namespace {

constexpr std::int64_t kWholeRun = std::numeric_limits<std::int64_t>::max();

// The same error with a remark at its end.
[[noreturn]] void throw_with(const Error& error, const std::string& remark) {
  const std::string message = fmt::format("{}; {}", error.what(), remark);
  if (const auto* const lost = dynamic_cast<const RankLost*>(&error))
    throw RankLost(message, lost->rank);
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

// How run() and step() go about their iterations.
struct Trainer::Impl::Loop {
  bool scheduled;  // with the evaluations and files of the options
  Progress& progress;
  const std::function<bool()>& interrupted;
};

// Work that is no training, when all steps are done.
void Trainer::Impl::untimed(const Loop& loop, const std::function<void()>& work) {
  finish_steps();
  clock.training.stop();
  loop.progress.suspend();
  work();
  loop.progress.resume();
  clock.training.start();
}

// For evaluations and validations, which take long: what would end the run after a step breaks them
// off.
MeasureWatch Trainer::Impl::watch_of(const Loop& loop) const {
  return {loop.progress.terminal(), [this, &loop] { return asked.stop || loop.interrupted(); }};
}

// Up to `until` completed iterations. The first thing is what the newest one lacks because an error
// or a signal came in between, or because it was made into another folder; not what would have
// been measured of a model that density control has changed since.
void Trainer::Impl::run_iterations(std::int64_t until, const Loop& loop) {
  bool stop = cut_off = false;
  {
    const auto turn = context.lock();
    const bool over = iteration == last_iteration(options) ||
                      ranks.broadcast_value(0, is_validated() && out_of_patience());
    const bool unchanged = iteration > 0 && !density.changes_at(iteration);
    if (pass_due || (loop.scheduled && (over || unchanged)))
      stop = finish_iteration(loop, false, pass_due);
  }
  while (iteration < std::min(until, last_iteration(options)) && !stop) {
    const auto turn = context.lock();
    stop = finish_iteration(loop, run_iteration(loop), true);
  }
  const auto turn = context.lock();
  finish_steps();
}

// One step and what is said of it. Returns whether the run is to end with this iteration.
bool Trainer::Impl::run_iteration(const Loop& loop) {
  if (ranks.size() > 1) asked.stop_wished = loop.interrupted() || asked.stop;
  if (judges_photos_at(options, loss_views(), iteration)) leave_out_odd_views();
  if (looks_for_motion_at(options, loss_views(), iteration)) leave_out_moving_areas();
  send_sampled_step();
  if (fit_end_to_time()) {
    loop.progress.set_total(last_iteration(options));
    untimed(loop, [this] { tell_fitted_end(); });
  }
  const bool last = iteration == last_iteration(options);
  if (last || every(options.log_every, iteration)) report(loop.progress);
  if (every(options.validate_every, iteration)) untimed(loop, [this] { validate_model(); });
  if (callback) {
    const auto hear = callback;  // it may be replaced meanwhile
    untimed(loop, [&] { hear({iteration, last_iteration(options), gaussians.count}); });
  }
  // Asked once: a signal that comes later is seen after the next step. Ranks end together.
  return ranks.size() > 1 ? asked.stop_agreed : loop.interrupted() || asked.stop;
}

// Whether a run of these options writes a model there, whatever happens to it.
bool Trainer::Impl::saves_model(std::int64_t at) const {
  const std::int64_t last = last_iteration(options);
  return at == last || (at < last && contains(options.save_at, options.iterations, at));
}

// What follows a step: evaluations and files, before density control, as in 3DGS, because fresh
// clones and children have not settled yet; then that, and the checkpoint. An interrupted run
// leaves evaluations, one that is broken off too, and density control to the one that goes on.
// Unless the iteration is `anew`, files that are there stay. Returns whether the run ends with it,
// as it does with `stop`. What is done together rank 0 decides: others may have a folder of their
// own, which says less.
bool Trainer::Impl::finish_iteration(const Loop& loop, bool stop, bool anew) {
  const bool last = iteration == last_iteration(options);
  bool ends = false;
  if (loop.scheduled && iteration > 0 && validation_due()) {
    if (!ranks.broadcast_value(0, is_validated()))
      untimed(loop, [&] { cut_off = !validate_views(watch_of(loop)); });
    ends = !cut_off && ranks.broadcast_value(0, out_of_patience());
    stop = stop || cut_off;
  }
  if (ends) {
    stop = ended = true;
    spdlog::info(
        "iteration {}: the validation views have not gained {} times in a row: the run ends here, "
        "and --resume goes on with a larger --patience alone",
        iteration, options.patience);
  }
  const bool evaluates =
      !cut_off && (ends || last ||
                   (!stop && (every(options.eval_every, iteration) ||
                              contains(options.eval_at, options.iterations, iteration))));
  const bool lacks_model = loop.scheduled && (anew || !run.has_model(iteration));
  const bool saves = lacks_model && (stop || saves_model(iteration));
  if (saves) untimed(loop, [this] { save_model(); });
  if (loop.scheduled && evaluates && !ranks.broadcast_value(0, is_evaluated(last || ends)))
    untimed(loop, [&] { cut_off = !evaluate_views(last || ends, watch_of(loop)); });
  stop = stop || cut_off;
  if (last) {
    pass_due = false;
  } else if (!cut_off && (ends || !stop)) {
    control_density();
  }
  const bool save_now = asked.save.exchange(false);
  if (!saves && (save_now || (cut_off && lacks_model))) untimed(loop, [this] { save_model(); });
  const bool keeps = loop.scheduled &&
                     (stop || last || every(options.checkpoint_every, iteration)) &&
                     (anew || !is_file(checkpoint_path(run.path(), iteration)));
  if (save_now || keeps) untimed(loop, [this] { save_checkpoint(); });
  if (watcher && !stop && watcher->wants_look())
    untimed(loop, [&] { let_watcher_look(loop.interrupted); });
  return stop;
}

// Lets the watcher look at the state between two steps, and hold it as long as it wishes.
void Trainer::Impl::let_watcher_look(const std::function<bool()>& interrupted) {
  const auto stopping = [&] { return asked.stop || interrupted(); };
  RunWish wish;
  do {
    wish = watcher->look(
        {iteration, background, sky ? tracer.sky()->light() : SkyLight(), &model_to_show()},
        stopping);
    if (!wish.save) continue;
    save_model();
    if (saved != iteration) save_checkpoint();
  } while (wish.wait && !stopping());
}

// Runs them with the folder locked. What fails is saved as far as it goes.
void Trainer::Impl::run_and_rescue(std::int64_t until,
                                   bool scheduled,
                                   bool show_progress,
                                   const std::function<bool()>& interrupted) {
  Progress progress("Training", last_iteration(options), iteration,
                    show_progress ? stderr : nullptr);
  {
    const auto turn = context.lock();
    clock.row_iteration = iteration;
    clock.row_seconds = clock.training.seconds();
    clock.training.start();
  }
  const auto stop_clock = [this] {
    const auto turn = context.lock();
    clock.training.stop();
  };
  try {
    run_iterations(until, {scheduled, progress, interrupted});
  } catch (const Error& error) {
    stop_clock();
    if (error.code() == ErrorCode::kRuntime) throw;  // the model itself is at fault
    throw_with(error, rescue());
  } catch (const std::bad_alloc&) {
    stop_clock();
    throw_with(ResourceError("The host has no memory left: use smaller images (--downscale) or a "
                             "smaller --image-budget"),
               rescue());
  } catch (...) {  // of a callback
    stop_clock();
    spdlog::warn("a callback failed after iteration {}: {}", iteration, rescue());
    throw;
  }
  stop_clock();
  progress.finish();
}

TrainSummary Trainer::Impl::train(bool show_progress) {
  const Busy busy(*this);
  const InterruptGuard interrupt(LostReader::kInterrupts);
  {
    const auto turn = context.lock();
    shows_progress = show_progress;
    make_first_model();
  }
  const FolderUse folder(*this);
  {
    const auto turn = context.lock();
    start();
  }
  run_and_rescue(kWholeRun, true, show_progress, [&] { return interrupt.requested(); });
  const auto turn = context.lock();
  ranks.barrier();  // what rank 0 writes is written
  const bool complete = iteration == last_iteration(options) && !cut_off;
  const bool over = complete || (ended && !cut_off);
  if (over) keep_best_model();
  write_metrics(over);
  if (const std::uint64_t capped = guard.counts().capped_rays; capped > 0)
    tell_of_capped_rays(capped);
  if (complete) warn_of_no_progress();
  if (const auto best = better_before(run.evaluations(), options.exposure)) {
    spdlog::warn(
        "the last PSNR of the test views, {:.2f} dB, is below that of iteration {}, {:.2f} dB: the "
        "run learns its photos by heart, its rates are too high, or something moves in the photos, "
        "which masks{} can leave out",
        judged_psnr(run.evaluations().back(), options.exposure), best->iteration,
        judged_psnr(*best, options.exposure),
        options.leave_out_moving || !options.mirrors.empty() ? "" : " or --leave-out-moving");
  }
  if (!over && !asked.stop) {
    throw Error(
        ErrorCode::kInterrupted,
        fmt::format("Interrupted at iteration {}; everything is saved: continue with --resume {}",
                    iteration, shell_word(run.path().string())));
  }
  TrainSummary summary;
  summary.iterations = iteration;
  summary.gaussians = gaussians.count;
  summary.loss = last_loss;
  summary.training_seconds = clock.training.seconds();
  summary.evaluation_seconds = clock.evaluating.seconds();
  summary.kernel_build_seconds = context.build_seconds();
  summary.evaluations = run.evaluations();
  return summary;
}

bool Trainer::Impl::run_steps(std::int64_t count) {
  if (count < 1) {
    throw UsageError(
        fmt::format("Trainer::step() cannot make {} iterations: ask for 1 or more", count));
  }
  const Busy busy(*this);
  begin_stepping();
  run_and_rescue(count < kWholeRun - iteration ? iteration + count : kWholeRun, false, false,
                 [] { return false; });
  return iteration < last_iteration(options);
}

// For steps of the caller's own: the folder stays locked until the trainer goes.
void Trainer::Impl::begin_stepping() {
  if (prepared) return;
  const auto turn = context.lock();
  make_first_model();
  if (!folder_lock && ranks.leads()) folder_lock.emplace(run.lock());
  start();
  prepared = true;
}

}  // namespace raysplats
