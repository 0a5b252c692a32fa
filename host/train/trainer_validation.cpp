// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <algorithm>

#include "raysplats/evaluation.hpp"
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

// Traces the validation views at full size. The model is kept while it is the best so far.
void Trainer::Impl::judge() {
  evaluating.start();
  Dataset judged = dataset;
  judged.views.clear();
  for (const std::size_t i : apart) {
    judged.views.push_back(dataset.views[train_views[i]]);
    judged.views.back().test = true;
  }
  set_background();
  const auto render = [this](const Camera& camera) {
    tracer.forward(shown(), camera);
    return tracer.download_image();
  };
  EvaluationOptions choice;
  choice.ranks = &ranks;
  const EvaluationReport report =
      raysplats::evaluate(render, judged, Split::kTest, background, {}, choice);
  // Nothing told the exposure of photos that were not trained on.
  const double psnr = exposure ? report.mean.psnr_corrected : report.mean.psnr;
  const std::vector<EvaluationRow>& rows = run.validations();
  std::int64_t former = 0;
  if (!rows.empty()) former = best_of(rows).iteration;
  run.record_validation({iteration, training.seconds(), psnr, report.mean.ssim,
                         report.images.size(), gaussians.count, report.mean.psnr_corrected,
                         report.mean.psnr_all, report.mean.psnr_aligned});
  if (best_of(rows).iteration == iteration) {
    save_model();
    if (former > 0 && !is_scheduled(options, former)) run.remove_model(former);
  }
  write_metrics(false);
  evaluating.stop();
  spdlog::info("iteration {}: PSNR {:.2f} dB over {} validation views", iteration, psnr,
               report.images.size());
}

bool Trainer::Impl::out_of_patience() const {
  const std::vector<EvaluationRow>& rows = run.validations();
  if (options.patience == 0 || rows.empty()) return false;
  const auto since = static_cast<std::size_t>(rows.data() + rows.size() - 1 - &best_of(rows));
  return since >= static_cast<std::size_t>(options.patience);
}

// At the end of a run: its best model stays, and is named, if the last validation was worse.
void Trainer::Impl::settle_validation() {
  const std::vector<EvaluationRow>& rows = run.validations();
  if (rows.empty() || (iteration < last_iteration(options) && !ended)) return;
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
