// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>

#include "raysplats/evaluation.hpp"
#include "run/train_config.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

constexpr double kMargin = 0.1;  // decibels by which an earlier model has to be better to be named

// The best of the validations; the earlier one of equals. `rows` are not empty.
const EvaluationRow& best_of(const std::vector<EvaluationRow>& rows) {
  return *std::max_element(
      rows.begin(), rows.end(),
      [](const EvaluationRow& a, const EvaluationRow& b) { return a.psnr < b.psnr; });
}

// Whether the options themselves ask for the model of an iteration.
bool is_scheduled(const TrainOptions& options, std::int64_t iteration) {
  return std::any_of(options.save_at.begin(), options.save_at.end(), [&](const RunShare& share) {
    return share.of(options.iterations) == iteration;
  });
}

}  // namespace

// The last one before the validation views are trained on too.
std::int64_t Trainer::Impl::join_iteration() const {
  return joined.value_or(validation_join(options));
}

// Those that steps are passes over. The views that join at the end of a run as it was planned come
// when passes are over.
std::size_t Trainer::Impl::loss_views() const {
  return joined ? train_views.size() : train_views.size() - apart.size();
}

// Of these, as many as a pass has.
std::size_t Trainer::Impl::pass_views() const {
  std::size_t out = loss_views();
  for (const CrowdedPlace& place : crowded.places) {
    const auto waits = std::ranges::count_if(place.photos, [this](std::size_t view) {
      return !joined && std::ranges::binary_search(apart, view);
    });
    const std::size_t here = place.photos.size() - static_cast<std::size_t>(waits);
    out -= here - std::min(here, crowded.most);
  }
  return out;
}

// A model that was trained on the views knows them: in a run that goes on for longer than it was
// to, they cannot judge again.
void Trainer::Impl::restore_joined_views(const Checkpoint& checkpoint) {
  joined.reset();
  if (apart.empty()) return;
  const std::int64_t planned = checkpoint.views_joined > 0 || checkpoint.config.empty()
                                   ? checkpoint.views_joined
                                   : validation_join(parse_train_config(checkpoint.config));
  const bool trained_on = planned > 0 && checkpoint.iteration > planned;
  if (trained_on && planned < validation_join(options)) {
    joined = planned;
    // Runs of older versions that train poses took them up as well.
    if (planned < validation_end(options)) {
      spdlog::warn(
          "the run was to be shorter, and its {} validation views have been trained on since "
          "iteration {}: they stay in the loss and judge no more; a new run of this length would "
          "be judged up to nine tenths of it",
          apart.size(), planned);
    }
  }
  const std::size_t limit = density.limit();
  apply_options();
  density.set_limit(limit);
}

bool Trainer::Impl::validation_due() const { return !joined && validates_at(options, iteration); }

// Whether this iteration has been.
bool Trainer::Impl::is_validated() const {
  const std::vector<EvaluationRow>& rows = run.validations();
  return !rows.empty() && rows.back().iteration == iteration;
}

// Traces the validation views at full size. The model is kept while it is the best so far. Nothing
// told exposure and pose of photos that were not trained on, so neither counts where it is found
// for the others: the better a model, the more an error of a pose would cost it. Returns whether it
// was done to its end: what was broken off leaves nothing.
bool Trainer::Impl::validate_views(const MeasureWatch& watch) {
  clock.evaluating.start();
  Dataset validation = dataset;
  validation.views.clear();
  for (const std::size_t i : apart) {
    validation.views.push_back(dataset.views[train_views[i]]);
    validation.views.back().test = true;
  }
  EvaluationOptions choice;
  choice.align = options.poses;
  choice.align_colors = exposure.has_value();
  choice.photo = [this](std::size_t i) { return evaluated_photo(train_views[apart[i]]); };
  const std::optional<EvaluationRow> measured = measure(validation, {}, choice, watch);
  if (!measured) {
    clock.evaluating.stop();
    return false;
  }
  EvaluationRow row = *measured;
  row.psnr = row.psnr_aligned.value_or(exposure ? row.psnr_corrected : row.psnr);
  const std::vector<EvaluationRow>& rows = run.validations();
  std::int64_t former = 0;
  if (!rows.empty()) former = best_of(rows).iteration;
  run.record_validation(row);
  if (best_of(rows).iteration == iteration) {
    save_model();
    if (former > 0 && !is_scheduled(options, former)) run.remove_model(former);
  }
  write_metrics(false);
  clock.evaluating.stop();
  spdlog::info("iteration {}: PSNR {:.2f} dB over {} validation views{}{}", iteration, row.psnr,
               row.views, options.poses ? ", each from where it fits its photo" : "",
               exposure ? ", in its photo's colours" : "");
  return true;
}

bool Trainer::Impl::out_of_patience() const {
  const std::vector<EvaluationRow>& rows = run.validations();
  if (options.patience == 0 || rows.empty()) return false;
  const auto since = static_cast<std::size_t>(rows.data() + rows.size() - 1 - &best_of(rows));
  return since >= static_cast<std::size_t>(options.patience);
}

// At the end of a run: its best model stays, and is named, if the last validation was worse.
void Trainer::Impl::keep_best_model() {
  const std::vector<EvaluationRow>& rows = run.validations();
  if (rows.empty()) return;
  const EvaluationRow& best = best_of(rows);
  if (best.psnr > rows.back().psnr + kMargin) {
    spdlog::warn(
        "the validation views were best at iteration {}, {:.2f} dB, and {:.2f} dB at iteration {}: "
        "the better model is kept as point_cloud/iteration_{}",
        best.iteration, best.psnr, rows.back().psnr, rows.back().iteration, best.iteration);
    return;
  }
  if (best.iteration != iteration && !is_scheduled(options, best.iteration))
    run.remove_model(best.iteration);
}

}  // namespace raysplats
