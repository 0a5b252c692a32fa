// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <system_error>
#include <utility>

#include "run/train_config.hpp"
#include "train/run_state.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {

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
  checkpoint.capped_rays = counts.capped_rays;
  store_state(gaussians, adam, density, checkpoint);
  store_mean(mean, checkpoint);
  if (footprint.lows().size() > 0) checkpoint.sections["footprint"] = footprint.lows().download();
  if (poses) {
    const PoseRefinement::State& state = poses->state();
    checkpoint.sections["poses"] = state.deltas;
    checkpoint.sections["poses.first"] = state.first;
    checkpoint.sections["poses.second"] = state.second;
    checkpoint.sections["poses.steps"] = state.steps;
  }
  if (sky) {
    checkpoint.sections["sky"] = tracer.sky()->coefficients().download();
    SkyAdam::State moments = sky->state();
    checkpoint.sections["sky.first"] = std::move(moments.first);
    checkpoint.sections["sky.second"] = std::move(moments.second);
    checkpoint.sections["sky.steps"] = std::move(moments.steps);
  }
  if (exposure) checkpoint.sections["exposure"] = exposure->deltas();
  return checkpoint;
}

void Trainer::Impl::save_checkpoint() {
  if (!ranks.leads()) return;
  write_checkpoint(checkpoint_path(run.path(), iteration), state());
  saved = iteration;
  remove_old_checkpoints(run.path(), options.keep_checkpoints, iteration);
}

// After a failure: saves the last whole state, if the device still gives it. Returns what the user
// can do then.
std::string Trainer::Impl::rescue() {
  const auto turn = context.lock();
  if (!ranks.leads()) {
    return fmt::format("what rank 0 has saved is in {}: continue with --resume {}",
                       run.path().string(), run.path().string());
  }
  if (whole) {
    try {
      abandon();
    } catch (const std::exception& error) {
      spdlog::warn("the steps on their way to iteration {} are lost: {}", iteration, error.what());
      whole = false;
    }
  }
  if (whole && saved != iteration) {
    try {
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
  differs("downscale", before.data.downscale, options.data.downscale);
  differs("test-every", before.data.test_every, options.data.test_every);
  differs("undistort", before.data.undistort, options.data.undistort);
  differs("validate-views", before.validate_views, options.validate_views);
  differs("exposure", before.exposure, options.exposure);
  differs("views-per-step", before.views_per_step, options.views_per_step);
  differs("poses", before.poses, options.poses);
  const auto degree = [](const TrainOptions& o) {
    return o.background == "sky" ? o.sky_degree : -1;  // -1 = no sky
  };
  differs("background = sky and sky-degree", degree(before), degree(options));
  const auto cuts = [](const TrainOptions& o) { return o.data.masks == MaskUse::kCutout; };
  differs("masks = cutout", cuts(before), cuts(options));
  const auto alpha = [](const TrainOptions& o, AlphaUse use) { return o.data.alpha == use; };
  for (const auto& [name, use] : {std::pair{"alpha = cutout", AlphaUse::kCutout},
                                  std::pair{"alpha = ignore", AlphaUse::kIgnore}})
    differs(name, alpha(before, use), alpha(options, use));
}

// All ranks read the same state, before one of them writes into the folder again.
void Trainer::Impl::resume(const std::filesystem::path& source) {
  take_up(source);
  const std::vector<std::int64_t> all = ranks.all(started ? iteration : -1);
  for (std::size_t rank = 1; rank < all.size(); ++rank) {
    if (all[rank] == all[0]) continue;
    throw DataError(fmt::format(
        "Rank 0 finds iteration {} in {} and rank {} iteration {}: put the run where all ranks see "
        "the same folder",
        all[0], source.string(), rank, all[rank]));
  }
}

void Trainer::Impl::take_up(const std::filesystem::path& source) {
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
  if (checkpoint.iteration > last_iteration(options)) {
    throw UsageError(fmt::format(
        "The run is at iteration {} already, beyond --iterations {}: raise them, or resume from an "
        "earlier checkpoint",
        checkpoint.iteration, last_iteration(options)));
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
  restore_mean(checkpoint, options, gaussians, mean);
  const auto lows = checkpoint.sections.find("footprint");
  if (lows != checkpoint.sections.end() && lows->second.size() == gaussians.count) {
    footprint.restore(lows->second);
  } else {
    footprint.update(gaussians);  // of a version that had none
  }
  const auto part = [&](const std::string& name) {
    const auto found = checkpoint.sections.find(name);
    return found == checkpoint.sections.end() ? std::vector<float>() : found->second;
  };
  if (poses)
    poses->restore({part("poses"), part("poses.first"), part("poses.second"), part("poses.steps")});
  if (exposure) exposure->restore(part("exposure"));
  if (sky) {
    sky->restore({part("sky.first"), part("sky.second"), part("sky.steps")});
    const std::vector<float> coefficients = part("sky");
    if (coefficients.size() != tracer.sky()->coefficients().size())
      throw DataError("The checkpoint lacks the sky of its run: resume from another one");
    tracer.sky()->set(coefficients);
  }
  // What the run began with, black in those of older versions.
  if (options.background == "auto" && !checkpoint.config.empty())
    options.background = parse_train_config(checkpoint.config).background;
  background = background_color(options, cut_out);
  if (options.color_range == 0 && !checkpoint.config.empty())
    options.color_range = parse_train_config(checkpoint.config).color_range;
  if (options.color_range == 0) options.color_range = 1;  // of a version that had none
  guard.restore(
      {checkpoint.bad_steps_in_a_row, checkpoint.bad_steps, false, checkpoint.capped_rays});
  reported_bad_steps = checkpoint.bad_steps;
  traced_rays = checkpoint.traced_rays;
  iteration = checkpoint.iteration;
  training.set(recorded_seconds(folder, iteration));
  started = true;
  whole = true;
}

}  // namespace raysplats
