// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "device/profiler.hpp"
#include "eval/metrics.hpp"
#include "raysplats/evaluation.hpp"
#include "run/former_metrics.hpp"
#include "scene/camera/view_axes.hpp"
#include "train/step_options.hpp"
#include "train/trainer_impl.hpp"
#include "util/shell_word.hpp"

namespace raysplats {
namespace {

constexpr double kManyCapped = 1e-3;  // share of rays at which the cap on hits gets a warning

// What the kernels of the timed steps took so far; with --profile all of them.
nlohmann::json kernels_of(Context& context) {
  nlohmann::json out = nlohmann::json::array();
  for (const Profiler::Row& row : context.profiler().rows()) {
    out.push_back(
        {{"name", row.kernel}, {"calls", row.calls}, {"ms", row.total_ms}, {"share", row.share}});
  }
  return out;
}

}  // namespace

// How sharp the training photos are that the run has read so far, and how near it came to those
// that it has seen at full size last; what this part of it has not seen, as it was before.
nlohmann::json Trainer::Impl::photo_report() const {
  nlohmann::json out = nlohmann::json::array();
  std::map<std::string, nlohmann::json> before = former_photos(*former);
  const std::vector<double> psnr = fit.psnr();
  for (std::size_t i = 0; i < train_cameras.size(); ++i) {
    const auto known = before.find(train_cameras[i].name);
    nlohmann::json photo = known != before.end() ? std::move(known->second) : nullptr;
    if (const std::optional<Sharpness> sharpness = photo_cache.sharpness_of(i)) {
      const glm::dvec3 center = train_cameras[i].center();
      photo["name"] = train_cameras[i].name;
      photo["sharpness"] = sharpness->fine;
      photo["coarse_sharpness"] = sharpness->coarse;
      photo["center"] = {center.x, center.y, center.z};
      // Panoramas look all around.
      if (train_cameras[i].model != CameraModel::kEquirectangular) {
        const glm::dvec3 direction = view_axis(train_cameras[i]);
        photo["direction"] = {direction.x, direction.y, direction.z};
      }
    }
    const bool is_left_out = std::binary_search(left_out.begin(), left_out.end(), i);
    const double moved = marked_share(moving[i]);
    if (is_left_out || moved > 0)
      photo["name"] = train_cameras[i].name;  // which this part may not have read
    if (photo.is_null()) continue;
    if (std::isfinite(psnr[i])) photo["psnr"] = std::min(psnr[i], kMostPsnr);
    photo.erase("left_out_from");
    if (is_left_out) photo["left_out_from"] = left_out_from;
    photo.erase("moving");
    if (moved > 0) photo["moving"] = moved;
    out.push_back(std::move(photo));
  }
  return out;
}

// Waits for the device and reports the step just done.
void Trainer::Impl::report(Progress& progress) {
  finish_steps();
  const auto [value, work] = last_view();
  const StepGuard::Counts counts = check_guard();
  last_loss = value.total;
  const double psnr = std::min(value.psnr, kMostPsnr);
  rise.note(order.at(last_turn()), resolution_divisor(options, iteration - 1), psnr);
  const double seconds = clock.training.seconds();
  const double elapsed = seconds - clock.row_seconds;
  const double speed =
      elapsed > 0 ? static_cast<double>(iteration - clock.row_iteration) / elapsed : 0.0;
  const TrainRow row{iteration,       seconds, value.total,     psnr,
                     gaussians.count, speed,   work.candidates, work.hits};
  run.append(row);
  if (watcher) watcher->noted(row);
  clock.row_iteration = iteration;
  clock.row_seconds = seconds;
  progress.update(iteration,
                  fmt::format("loss {:.4f}, PSNR {:.2f} of this view, {} Gaussians{}", value.total,
                              psnr, gaussians.count, capped_share(counts.capped_rays)));
}

// What the progress line says of rays that the cap on hits cut off; the first time that they are
// many, a warning does too.
std::string Trainer::Impl::capped_share(std::uint64_t capped) {
  if (capped == 0) return "";
  const double share = static_cast<double>(capped) / static_cast<double>(traced_rays);
  if (share >= kManyCapped && !cap_reported) {
    cap_reported = true;
    tell_of_capped_rays(capped);
  }
  return fmt::format(", {:.2g} % of rays capped", 100.0 * share);
}

// A handful is nothing that a user has to mend.
void Trainer::Impl::tell_of_capped_rays(std::uint64_t capped) const {
  const bool many = static_cast<double>(capped) >= kManyCapped * static_cast<double>(traced_rays);
  spdlog::log(
      many ? spdlog::level::warn : spdlog::level::info,
      "iteration {}: {} of {} rays traced so far stopped at --max-hits {} and miss what lies "
      "behind{}",
      iteration, capped, traced_rays, options.trace.max_hits, many ? ": raise it" : "");
}

// Warns when no picture came nearer to its photo.
void Trainer::Impl::warn_of_no_progress() const {
  if (!rise.learned_nothing()) return;
  spdlog::warn(
      "the model learned nothing: the PSNR of no training view rose by more than {} dB; see "
      "whether cameras, points and photos belong together ('raysplats info {}')",
      PsnrRise::kLeast, shell_word(dataset.root.string()));
}

// Measures the model by the views of a data set that are held out, of which each rank traces a
// share. Pictures go to `folder`. Nothing, on all ranks, where any of them has broken it off.
std::optional<EvaluationRow> Trainer::Impl::measure(const Dataset& views,
                                                    const std::filesystem::path& folder,
                                                    EvaluationOptions choice,
                                                    const MeasureWatch& watch) {
  std::size_t count = views.indices(Split::kTest).size();
  if (choice.max_views > 0) count = std::min(count, choice.max_views);
  // As many as the rank that shows it has of them.
  const std::size_t shown =
      (count + static_cast<std::size_t>(ranks.size()) - 1) / static_cast<std::size_t>(ranks.size());
  Progress progress("Evaluating", static_cast<std::int64_t>(shown), 0, watch.terminal);
  std::int64_t finished = 0;
  bool stopped = false;
  const auto goes_on = [&] {
    progress.update(finished, "");
    stopped = stopped || (watch.stopping && watch.stopping());
    return !stopped;
  };
  set_background();
  DeviceGaussians room;
  const DeviceGaussians& model = model_to_measure(room);
  const auto render = [&](const Camera& camera) {
    if (!goes_on()) return Image();
    tracer.forward(model, camera);
    return tracer.download_image();
  };
  choice.ranks = &ranks;
  choice.done = [&](std::size_t done) {
    finished = static_cast<std::int64_t>(done);
    return goes_on();
  };
  const EvaluationReport report =
      raysplats::evaluate(render, views, Split::kTest, background, folder, choice);
  progress.suspend();
  if (ranks.all_reduce_or(stopped)) return std::nullopt;
  EvaluationRow row;
  row.iteration = iteration;
  row.training_seconds = clock.training.seconds();
  row.psnr = report.mean.psnr;
  row.ssim = report.mean.ssim;
  row.views = report.images.size();
  row.gaussians = model.count;
  row.psnr_corrected = report.mean.psnr_corrected;
  row.psnr_all = report.mean.psnr_all;
  row.psnr_aligned = report.mean.psnr_aligned;
  return row;
}

// Measures the test views; the time counts as evaluation, not as training. Returns whether it was
// done to its end: what was broken off leaves nothing.
bool Trainer::Impl::evaluate_views(bool last, const MeasureWatch& watch) {
  if (test_views.empty()) return true;
  clock.evaluating.start();
  EvaluationOptions choice;
  choice.max_views = last ? 0 : static_cast<std::size_t>(options.eval_views);
  choice.max_pictures = static_cast<std::size_t>(options.eval_renders);
  choice.align = last && options.poses;
  choice.photo = [this](std::size_t view) { return evaluated_photo(view); };
  const std::optional<EvaluationRow> row =
      measure(dataset, run.evaluation_folder(iteration), choice, watch);
  if (!row) {
    run.remove_evaluation(iteration);
    clock.evaluating.stop();
    return false;
  }
  run.record(*row);
  if (watcher) watcher->evaluated(run.evaluations().back());
  write_metrics(false);
  clock.evaluating.stop();
  spdlog::info("iteration {}: PSNR {:.2f} dB, SSIM {:.4f} over {} test views after {} of training",
               iteration, row->psnr, row->ssim, row->views,
               format_duration(clock.training.seconds()));
  if (row->psnr_aligned) {
    spdlog::info("with cameras moved to where they fit the photos best, PSNR is {:.2f} dB",
                 *row->psnr_aligned);
  }
  return true;
}

// Whether this iteration has been evaluated; with `last` as the end of a run is, with all views and
// by all measures.
bool Trainer::Impl::is_evaluated(bool last) const {
  if (test_views.empty()) return true;
  const std::vector<EvaluationRow>& rows = run.evaluations();
  if (rows.empty() || rows.back().iteration != iteration) return false;
  if (!last) return true;
  const auto some = static_cast<std::size_t>(options.eval_views);
  const bool partial = some > 0 && some < test_views.size() && rows.back().views <= some;
  return !partial && (!options.poses || rows.back().psnr_aligned.has_value());
}

const DeviceGaussians& Trainer::Impl::model_to_show() const {
  return mean.known() ? mean.model() : gaussians;
}

Gaussians Trainer::Impl::model_to_save() const {
  return inside(model_to_show().download(), about_origin(options.bounds, dataset.origin));
}

// The model as its PLY holds it: between passes of density control some may have left the box. Then
// those that stay are in `room`.
const DeviceGaussians& Trainer::Impl::model_to_measure(DeviceGaussians& room) const {
  if (!options.bounds) return model_to_show();
  const Gaussians kept = model_to_save();
  if (kept.size() == model_to_show().count) return model_to_show();
  room = DeviceGaussians::upload(context, kept, ScaleActivation::kExp);
  return room;
}

// Behind views that are judged. A sky is with the tracer already.
void Trainer::Impl::set_background() {
  if (!sky) tracer.set_background(background);
}

TraceOptions Trainer::Impl::trace_options() {
  TraceOptions out = trace_options_of(options, background);
  if (sky) out.sky = tracer.sky()->light();
  return out;
}

void Trainer::Impl::save_model() {
  if (!ranks.leads()) return;
  run.write_model(model_to_save(), trace_options(), iteration, dataset.origin);
  if (exposure) run.write_exposures(train_cameras, exposure->deltas());
  if (poses) run.write_refined_cameras(poses->cameras(), dataset.origin);
}

void Trainer::Impl::write_metrics(bool complete) {
  if (!ranks.leads()) return;
  const StepGuard::Counts counts = guard.counts();
  const DeviceInfo& device = context.device();
  const std::string hash = run.model_hash(iteration);
  nlohmann::json now{{"version", RAYSPLATS_VERSION},
                     {"seed", options.seed},
                     {"command", command},
                     {"data", fingerprint},
                     {"model_hash", hash.empty() ? nlohmann::json(nullptr) : nlohmann::json(hash)},
                     {"complete", complete},
                     {"iteration", iteration},
                     {"iterations", last_iteration(options)},
                     {"gaussians", gaussians.count},
                     {"most_gaussians", density.limit()},
                     {"loss", last_loss},
                     {"training_seconds", clock.training.seconds()},
                     {"evaluation_seconds", clock.evaluating.seconds()},
                     {"kernel_build_seconds", context.build_seconds()},
                     {"traced_rays", traced_rays},
                     {"capped_rays", counts.capped_rays},
                     {"psnr_rise", rise.most() ? nlohmann::json(*rise.most()) : nullptr},
                     {"skipped_updates", skipped_before + adam.skipped()},
                     {"bad_steps", counts.bad_steps},
                     {"peak_device_bytes", context.peak_allocated_bytes()},
                     {"device", device.name},
                     {"driver", fmt::format("{}, {}", device.platform, device.driver_version)},
                     {"photo_warnings", photo_warnings},
                     {"camera_warnings", camera_warnings},
                     {"photos", photo_report()},
                     {"timed_steps", timed_steps},
                     {"kernels", kernels_of(context)}};
  run.write_metrics(continued_metrics(std::move(now), *former, stepped));
}

}  // namespace raysplats
