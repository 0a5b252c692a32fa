// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <optional>
#include <string>
#include <system_error>
#include <tuple>
#include <utility>

#include "run/dataset_fingerprint.hpp"
#include "run/train_config.hpp"
#include "train/run_state.hpp"
#include "train/trainer_impl.hpp"
#include "util/file_kind.hpp"
#include "util/shell_word.hpp"

namespace raysplats {
namespace {

// Of the data as a run of that configuration takes them: with depth maps where it trains on depths.
// The weight of depths may change, as others do.
std::string fingerprint_for(const std::string& config, const Dataset& dataset) {
  return dataset_fingerprint(dataset,
                             !config.empty() && parse_train_config(config).depth_weight > 0);
}

// What decides which photos a run has, and what of them counts.
auto reading(const DatasetOptions& o) {
  return std::tuple(o.factor(), o.test_list ? 0 : o.test_every, o.test_list, o.undistort, o.masks,
                    o.alpha);
}

// Whether lists beside its COLMAP model divide a data set, which programs without `--test-list` did
// not heed. Of several photos counting would have held out some.
bool divided_by_lists(const Dataset& dataset, const DatasetOptions& options) {
  return dataset.kind == DatasetKind::kColmap && dataset.read_as && !options.test_list &&
         options.test_every > 0 && dataset.test_every == 0 && dataset.views.size() > 1;
}

}  // namespace

// The state between two steps, or with density control still to come.
void Trainer::Impl::write_state(const std::filesystem::path& path) {
  Checkpoint checkpoint;
  checkpoint.iteration = iteration;
  checkpoint.seed = options.seed;
  checkpoint.scene_extent = extent;
  checkpoint.dataset = fingerprint;
  checkpoint.split = split_fingerprint(dataset);
  checkpoint.config = to_toml(options);
  const StepGuard::Counts counts = guard.counts();
  checkpoint.bad_steps = counts.bad_steps;
  checkpoint.bad_steps_in_a_row = counts.in_a_row;
  checkpoint.traced_rays = traced_rays;
  checkpoint.capped_rays = counts.capped_rays;
  checkpoint.skipped_updates = skipped_before + adam.skipped();
  if (!apart.empty()) checkpoint.views_joined = join_iteration();
  checkpoint.pass_due = pass_due && iteration < last_iteration(options);
  CheckpointSections sections = store_state(gaussians, adam, density, checkpoint);
  sections.merge(store_mean(mean, checkpoint));
  if (footprint.lows().size() > 0)
    sections["footprint"] = [this] { return footprint.lows().download(); };
  const auto add = [&sections](const char* name, std::vector<float> numbers) {
    sections[name] = [numbers = std::move(numbers)] { return numbers; };
  };
  if (poses) {
    const PoseRefinement::State& state = poses->state();
    add("poses", state.deltas);
    add("poses.first", state.first);
    add("poses.second", state.second);
    add("poses.steps", state.steps);
  }
  if (sky) {
    add("sky", tracer.sky()->coefficients().download());
    SkyAdam::State moments = sky->state();
    add("sky.first", std::move(moments.first));
    add("sky.second", std::move(moments.second));
    add("sky.steps", std::move(moments.steps));
  }
  if (exposure) add("exposure", exposure->deltas());
  add("motion", {motion});
  store_left_out(checkpoint, sections);
  store_moving(sections);
  write_checkpoint(path, checkpoint, sections);
}

// With what the run says of itself: one that is killed and goes on from here would not know its
// commands, and how near it came to each photo. That goes first: a run that goes on from an older
// state says it anew, step by step, and drops later evaluations.
void Trainer::Impl::save_checkpoint() {
  if (!ranks.leads()) return;
  write_metrics(false);
  write_state(checkpoint_path(run.path(), iteration));
  saved = iteration;
  remove_old_checkpoints(run.path(), options.keep_checkpoints, iteration);
}

// After a failure: saves the last whole state, if the device still gives it. Returns what the user
// can do then.
std::string Trainer::Impl::rescue() {
  const auto turn = context.lock();
  if (!ranks.leads()) {
    return fmt::format("what rank 0 has saved is in {}: continue with --resume {}",
                       run.path().string(), shell_word(run.path().string()));
  }
  if (whole) {
    try {
      drop_unfinished();
    } catch (const std::exception& error) {
      spdlog::warn("the steps on their way to iteration {} are lost: {}", iteration, error.what());
      whole = false;
    }
  }
  if (whole && saved != iteration) {
    try {
      write_state(checkpoint_path(run.path(), iteration));
      saved = iteration;
    } catch (const std::exception& error) {
      spdlog::warn("the state of iteration {} cannot be saved: {}", iteration, error.what());
    }
    try {
      if (saved == iteration) write_metrics(false);
    } catch (const std::exception& error) {
      spdlog::warn("what the run says of itself cannot be written: {}", error.what());
    }
  }
  if (saved < 0) return "nothing was saved yet";
  return fmt::format("iteration {} is saved: continue with --resume {}", saved,
                     shell_word(run.path().string()));
}

// The photos as the run saw them: another size or choice of them is another run.
void Trainer::Impl::check_data_options(const Checkpoint& checkpoint) const {
  if (checkpoint.config.empty()) return;
  const TrainOptions before = parse_train_config(checkpoint.config);
  TrainOptions now = options;
  // Programs of older versions left downscale open, whatever they read.
  if (before.data.downscale == 0 && reading(before.data) == reading(said_data) &&
      reading(said_data) != reading(now.data)) {
    spdlog::warn(
        "the run does not say how its data set was read: whether it was read as now is not known");
    now.data = said_data;
  }
  const auto differs = [&](const char* option, const auto& was, const auto& is) {
    if (was == is) return;
    throw UsageError(fmt::format(
        "The checkpoint of iteration {} was made with '{}' = {}, not {}: resume with the value of "
        "the run, or start a new one with --init",
        checkpoint.iteration, option, was, is));
  };
  differs("downscale", before.data.factor(), now.data.factor());
  if (!before.data.test_list && !now.data.test_list)
    differs("test-every", before.data.test_every, now.data.test_every);
  if (!checkpoint.split.empty() && checkpoint.split != split_fingerprint(dataset)) {
    const bool by_files = before.data.test_list == now.data.test_list;
    throw UsageError(fmt::format(
        "The checkpoint of iteration {} was made with other photos held out than {} now: {}, or "
        "start a new run with --init",
        checkpoint.iteration,
        by_files             ? "the files of " + dataset.root.string() + " say"
        : now.data.test_list ? "'test-list' says"
                             : "'test-every' says",
        by_files ? "bring their lists back, or name the photos by --test-list"
                 : "leave that to the run's configuration, which says what it held out"));
  }
  differs("undistort", before.data.undistort, now.data.undistort);
  differs("validate-views", before.validate_views, now.validate_views);
  differs("exposure", before.exposure, now.exposure);
  differs("views-per-step", before.views_per_step, now.views_per_step);
  differs("poses", before.poses, now.poses);
  const auto degree = [](const TrainOptions& o) {
    return o.background == "sky" ? o.sky_degree : -1;  // -1 = no sky
  };
  differs("background = sky and sky-degree", degree(before), degree(now));
  const auto cuts = [](const TrainOptions& o) { return o.data.masks == MaskUse::kCutout; };
  differs("masks = cutout", cuts(before), cuts(now));
  const auto alpha = [](const TrainOptions& o, AlphaUse use) { return o.data.alpha == use; };
  // Runs name their background, but for those of cut-out photos; what `auto` makes of transparency
  // may differ between versions.
  const bool was_cut_out = before.background == "auto" && checkpoint.iteration > 0;
  const bool by_auto = was_cut_out && alpha(before, AlphaUse::kAuto);
  if (by_auto && !cut_out && alpha(now, AlphaUse::kAuto)) {
    spdlog::warn(
        "the run names no background, as those of cut-out photos, which the photos of {} are not: "
        "if they were, resume with --alpha cutout",
        dataset.root.string());
  }
  if (!(by_auto && alpha(now, AlphaUse::kCutout)))
    differs("alpha = cutout", alpha(before, AlphaUse::kCutout), alpha(now, AlphaUse::kCutout));
  differs("alpha = ignore", alpha(before, AlphaUse::kIgnore), alpha(now, AlphaUse::kIgnore));
}

// Models that come after the state to go on from are written again by a run of the length that they
// are of, and by one that saves at the newest. Another one would leave them, and the newest model
// is taken for a run's result.
void Trainer::Impl::check_newer_models(std::int64_t from) const {
  const std::optional<std::int64_t> newest = run.newest_model();
  if (overwrite || !newest || *newest <= from) return;
  const std::int64_t last = last_iteration(options);
  const bool same = *newest <= last && (!resumed || resumed->iterations == options.iterations);
  if (same || saves_model(*newest)) return;
  throw UsageError(fmt::format(
      "The run in {} has left a model of iteration {}, which one of {} iterations that goes on "
      "from {} would not make again: give it the length that it had, choose another folder, or "
      "drop what came after iteration {} by --overwrite",
      run.path().string(), *newest, last, from, from));
}

// All ranks read the same state, before one of them writes into the folder again.
void Trainer::Impl::resume(const std::filesystem::path& source) {
  restore_from(source);
  const std::vector<std::int64_t> all = ranks.all_gather(started ? iteration : -1);
  for (std::size_t rank = 1; rank < all.size(); ++rank) {
    if (all[rank] == all[0]) continue;
    throw DataError(fmt::format(
        "Rank 0 finds iteration {} in {} and rank {} iteration {}: put the run where all ranks see "
        "the same folder",
        all[0], source.string(), rank, all[rank]));
  }
}

// Runs of programs that did not heed lists beside COLMAP models held out other photos, and do not
// say which.
void Trainer::Impl::check_lists(const Checkpoint& checkpoint) const {
  if (!checkpoint.split.empty() || checkpoint.config.empty()) return;
  const DatasetOptions before = parse_train_config(checkpoint.config).data;
  if (before.test_list || before.test_every == 0 || !divided_by_lists(dataset, options.data))
    return;
  throw UsageError(fmt::format(
      "The checkpoint of iteration {} was made before lists of test photos beside COLMAP models "
      "counted, as {} has: move the list away, or start a new run with --init",
      checkpoint.iteration, dataset.root.string()));
}

// Whether the state is one of this run: of its seed, data, options of data and length.
void Trainer::Impl::check_fits(const Checkpoint& checkpoint) const {
  if (checkpoint.seed != options.seed) {
    throw UsageError(fmt::format(
        "The checkpoint was made with seed {}, not {}: resume with the configuration of the run",
        checkpoint.seed, options.seed));
  }
  check_lists(checkpoint);
  if (!checkpoint.dataset.empty() && checkpoint.dataset != fingerprint &&
      checkpoint.dataset != fingerprint_for(checkpoint.config, dataset)) {
    // Lists may leave photos out.
    const auto list_of = [](const std::string& config) {
      return config.empty() ? std::nullopt : parse_train_config(config).data.test_list;
    };
    throw UsageError(fmt::format(
        "The checkpoint of iteration {} was made with other data than {}: resume with the photos, "
        "cameras and {} of the run, or start a new one with --init",
        checkpoint.iteration, dataset.root.string(),
        list_of(checkpoint.config) == options.data.test_list ? "lists of held-out photos"
                                                             : "'test-list' or 'test-every'"));
  }
  check_data_options(checkpoint);
  if (checkpoint.iteration > last_iteration(options)) {
    throw UsageError(fmt::format(
        "The run is at iteration {} already, beyond --iterations {}: raise them, or resume from an "
        "earlier checkpoint",
        checkpoint.iteration, last_iteration(options)));
  }
  if (checkpoint.scene_extent > 0 && std::abs(checkpoint.scene_extent - extent) > 1e-6 * extent) {
    spdlog::warn(
        "the checkpoint of iteration {} is of another version, which counted lengths by {:.6g} in "
        "place of {:.6g}: rates and sizes change from here on",
        checkpoint.iteration, checkpoint.scene_extent, extent);
  }
}

// Tells whether the run goes on in its own folder, where nothing may have come after the state.
void Trainer::Impl::choose_folder(const std::filesystem::path& place,
                                  const Checkpoint& checkpoint) {
  const bool file = is_file(place);
  const std::optional<std::filesystem::path> folder = run_folder_of(place);
  std::error_code error;
  continues = folder && std::filesystem::equivalent(*folder, run.path(), error);
  const std::vector<std::filesystem::path> files = list_checkpoints(run.path());
  if (continues && file && !overwrite && !files.empty() &&
      files.back() > checkpoint_path(run.path(), checkpoint.iteration)) {
    throw UsageError(fmt::format(
        "The run in {} has gone on to {} after this checkpoint: go on from there with --resume "
        "latest, choose another folder, or drop what came after iteration {} by --overwrite",
        run.path().string(), files.back().filename().string(), checkpoint.iteration));
  }
}

// What the state holds besides Gaussians, moments and their mean.
void Trainer::Impl::restore_parts(const Checkpoint& checkpoint) {
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
  const std::vector<float> unit = part("motion");
  // Versions that have none did not look at the points.
  motion =
      unit.size() == 1 ? unit[0] : static_cast<float>(motion_extent(train_cameras, extent, {}));
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
}

void Trainer::Impl::restore_from(const std::filesystem::path& source) {
  const bool own = source == "latest";
  const std::filesystem::path place = own ? run.path() : source;
  if (own && list_checkpoints(place).empty()) {
    check_newer_models(0);
    spdlog::info("{} holds no checkpoint yet: the run starts anew", place.string());
    continues = true;
    return;
  }
  // Nobody else has a folder that is not there yet, and it is made when there is a state to go on
  // from.
  std::optional<FolderUse> use;
  if (is_folder(run.path())) use.emplace(*this);
  const Checkpoint checkpoint = load_latest_checkpoint(place);
  check_fits(checkpoint);
  choose_folder(place, checkpoint);
  if (!checkpoint.config.empty()) resumed = parse_train_config(checkpoint.config);
  if (continues) check_newer_models(checkpoint.iteration);
  restore_joined_views(checkpoint);
  restore_left_out(checkpoint);
  restore_moving(checkpoint);
  restore_state(context, checkpoint, options, gaussians, adam, density);
  restore_mean(checkpoint, options, gaussians, mean);
  restore_parts(checkpoint);
  // What the run began with, black in those of older versions.
  if (options.background == "auto" && resumed) options.background = resumed->background;
  background = background_color(options, cut_out);
  if (options.color_range == 0 && resumed) options.color_range = resumed->color_range;
  if (options.color_range == 0) options.color_range = 1;  // of a version that had none
  guard.restore(
      {checkpoint.bad_steps_in_a_row, checkpoint.bad_steps, false, checkpoint.capped_rays});
  reported_bad_steps = checkpoint.bad_steps;
  traced_rays = checkpoint.traced_rays;
  skipped_before = checkpoint.skipped_updates;
  iteration = checkpoint.iteration;
  pass_due = checkpoint.pass_due;
  if (const std::optional<std::filesystem::path> folder = run_folder_of(place))
    clock.training.set(recorded_seconds(*folder, iteration));
  started = true;
  whole = true;
}

}  // namespace raysplats
