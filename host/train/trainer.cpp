// SPDX-License-Identifier: Apache-2.0
#include "raysplats/trainer.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <span>
#include <utility>

#include "io/dataset/data_option_table.hpp"
#include "io/dataset/dataset_views.hpp"
#include "io/photo/photo.hpp"
#include "raysplats/error.hpp"
#include "run/dataset_fingerprint.hpp"
#include "run/mirror_meshes.hpp"
#include "run/train_config.hpp"
#include "run/train_option_table.hpp"
#include "trace/memory_shares.hpp"
#include "train/ignored_photos.hpp"
#include "train/memory_estimate.hpp"
#include "train/step_options.hpp"
#include "train/trainer_impl.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

std::vector<View> views_of(const Dataset& dataset, const std::vector<std::size_t>& indices) {
  std::vector<View> views;
  views.reserve(indices.size());
  for (const std::size_t index : indices) views.push_back(dataset.views[index]);
  return views;
}

// What photos and depth maps may take of the device: all of them if there is room, else parts in
// the proportion of what they would. What both leave is for the photos of evaluations.
struct PictureBudget {
  std::size_t photos, depths, left;

  static PictureBudget of(const TrainOptions& options,
                          const Dataset& dataset,
                          std::span<const std::size_t> views) {
    const std::size_t budget = static_cast<std::size_t>(options.image_budget) * kMiB;
    std::size_t photos = 0;
    for (const std::size_t view : views) photos += io::photo_bytes(dataset.views[view]);
    std::size_t maps = options.depth_weight > 0 ? depth_map_bytes(dataset, views) : 0;
    const std::size_t left = budget - std::min(budget, photos + maps);
    if (photos + maps > budget) {
      maps = static_cast<std::size_t>(static_cast<double>(budget) * static_cast<double>(maps) /
                                      static_cast<double>(photos + maps));
    }
    return {budget - maps, maps, left};
  }
};

// How the data set was read, which options may leave to it. Throws UsageError where they say
// something else: the run would be evaluated on other pictures than it was trained on.
DatasetOptions data_options(DatasetOptions said, const Dataset& dataset) {
  DatasetOptions read = dataset.read_as.value_or(said), usual;
  read.origin = dataset.origin;
  if (!dataset.read_as) return read;
  const std::vector<OptionRow> of_said = data_option_rows(said);
  const std::vector<OptionRow> of_read = data_option_rows(read);
  const std::vector<OptionRow> of_usual = data_option_rows(usual);
  for (std::size_t i = 0; i < of_said.size(); ++i) {
    const std::string text = of_said[i].text();
    if (text == of_usual[i].text() || text == of_read[i].text()) continue;
    throw UsageError(fmt::format(
        "The options of the run say '{}' = {}, and its data set was read with {}: read it with the "
        "same, or leave that option out",
        of_said[i].name, brief_value(text), brief_value(of_read[i].text())));
  }
  return read;
}

// Whether any view for training may be traced in packets, and not ray by ray.
bool may_trace_packets(const TrainOptions& options, const Dataset& dataset) {
  if (!options.mirrors.empty() || options.trace.traversal == Traversal::kBvh) return false;
  return std::any_of(dataset.views.begin(), dataset.views.end(), [](const View& view) {
    return !view.test && view.camera.model != CameraModel::kOrthographic;
  });
}

TrainOptions complete_options(TrainOptions options, const Dataset& dataset) {
  check_train_options(options);
  options.data = data_options(options.data, dataset);
  if (float& footprint = options.trace.view_footprint; !may_trace_packets(options, dataset)) {
    if (footprint != 0 && footprint != TrainOptions().trace.view_footprint)
      spdlog::warn(
          "--view-footprint {:g} is left out: its gradient is not known where rays are traced one "
          "by one",
          footprint);
    footprint = 0;  // so that the files of the run say how the model was trained
  }
  options.iterations = run_length(options, dataset.indices(Split::kTrain).size());
  validate(options);
  return options;
}

}  // namespace

Trainer::Impl::Impl(Context& device,
                    Dataset data,
                    const TrainOptions& train_options,
                    std::filesystem::path run_path,
                    bool replace,
                    Communicator* others)
    : context(device),
      ranks(others != nullptr ? *others : alone),
      dataset(without_ignored_photos(std::move(data))),
      said_data(train_options.data),
      options(complete_options(train_options, dataset)),
      run(std::move(run_path), ranks.leads()),
      overwrite(replace),
      train_views(dataset.indices(Split::kTrain)),
      test_views(dataset.indices(Split::kTest)),
      train_cameras(cameras_of(dataset, train_views)),
      extent(scene_extent(train_cameras, dataset.points)),
      cut_out(dataset.alpha_is_background),
      fingerprint(dataset_fingerprint(dataset, options.depth_weight > 0)),
      background(background_color(options, cut_out)),
      tracer(device,
             trace_options_of(options, background),
             load_mirrors(options.mirrors, options.mirror_bounces, dataset.origin)),
      loss(device,
           options.pixel_loss,
           {static_cast<float>(options.ssim_weight), static_cast<float>(options.alpha_weight)}),
      adam(device, adam_options_of(options)),
      apart(validation_views(train_views.size(), options.validate_views)),
      crowded(options.even_places
                  ? crowded_places(train_cameras,
                                   subject_distances(train_cameras, dataset.points, extent))
                  : CrowdedPlaces()),
      moving(train_views.size()),
      density(device, options, extent, pass_views()),
      footprint(device,
                train_cameras,
                options.footprint,
                {options.scale_min * extent, options.scale_max * extent}),
      mean(device),
      guard(device),
      fit(device, train_views.size()),
      photo_cache(device,
                  views_of(dataset, train_views),
                  PictureBudget::of(options, dataset, train_views).photos,
                  kReadAhead),
      slots(static_cast<std::size_t>(options.views_per_step)),
      share(RankShare::of(slots.size(), ranks.rank(), ranks.size())),
      sum(device) {
  if (slots.size() < static_cast<std::size_t>(ranks.size())) {
    throw UsageError(fmt::format(
        "The {} ranks (processes, or devices of --device) of a run share the views of a step, and "
        "'views-per-step' = {} leaves some without one: give at least as many views as ranks",
        ranks.size(), slots.size()));
  }
  apply_options();
  if (options.strategy == DensityStrategy::kMcmc)
    mcmc.emplace(device, options, subject_length(train_cameras, dataset.points, extent));
  reset_exposure();
  reset_sky();
  reset_poses();
  check_views_and_options();
  if (options.depth_weight > 0) {
    require_depth_gradients();
    depths.emplace(device, dataset, train_views, options.depth_weight, options.depth_unit,
                   PictureBudget::of(options, dataset, train_views).depths);
  }
  if (apart.size() < static_cast<std::size_t>(options.validate_views)) {
    throw UsageError(fmt::format(
        "The option 'validate-views' = {} leaves less than {} of the {} training views to train "
        "on: keep fewer apart",
        options.validate_views, kLeastTrained, train_views.size()));
  }
}

// The photo of a view that is evaluated. Where the device's memory is the host's, nothing is kept
// in what the run may need of it.
std::shared_ptr<const ViewPicture> Trainer::Impl::evaluated_photo(std::size_t view) {
  if (!evaluated_photos) {
    std::size_t room = PictureBudget::of(options, dataset, train_views).left;
    const DeviceInfo& device = context.device();
    if (device.type == DeviceType::kCpu) {
      const std::size_t usable = usable_memory(device);
      const std::size_t needed = estimate_memory(options, demand(density.limit()), device).total();
      room = std::min(room, usable - std::min(usable, needed));
    }
    evaluated_photos.emplace(room);
  }
  return evaluated_photos->get(view, dataset.views[view]);
}

// That there are views to train on, and that they allow the options.
void Trainer::Impl::check_views_and_options() const {
  if (options.scale_activation == ScaleActivation::kSigmoid && options.scale_min * extent >= 1) {
    throw UsageError(
        fmt::format("The option 'scale-min' = {} is {:.3g} units of this data set, and with "
                    "'scale-activation' = sigmoid no axis is as long as one: lower it, or use exp",
                    options.scale_min, options.scale_min * extent));
  }
  if (options.background == "sky" && cut_out) {
    throw UsageError(
        "The option 'background' = sky is for photos that show one, but these are cut out: leave "
        "it at auto, or choose 'masks' = ignore and 'alpha' = ignore");
  }
  if (train_views.empty()) {
    const bool by_list = options.data.test_list && !test_views.empty();
    const bool by_option = options.data.test_every == 1 && !test_views.empty();
    throw UsageError(fmt::format(
        "The data set {} has no training views: {}", dataset.root.string(),
        by_list     ? "the list of test photos names all of them that its files do not leave out"
        : by_option ? "--test-every 1 holds all of them out"
        : !test_views.empty() ? "its files hold all of them out; let them name some for training"
                              : "its files name none to train on"));
  }
}

Trainer::Trainer(Context& context,
                 Dataset dataset,
                 const TrainOptions& options,
                 std::filesystem::path run_folder,
                 bool overwrite,
                 Communicator* ranks) {
  const auto turn = context.lock();
  impl_ = std::make_unique<Impl>(context, std::move(dataset), options, std::move(run_folder),
                                 overwrite, ranks);
}
Trainer::~Trainer() = default;

void Trainer::resume(const std::filesystem::path& source) {
  const auto turn = impl_->context.lock();
  if (impl_->busy) Impl::refuse_while_busy();
  impl_->resume(source);
}

TrainSummary Trainer::run(bool show_progress) { return impl_->train(show_progress); }

RunEstimate Trainer::estimate(double seconds, bool show_progress) {
  const auto turn = impl_->context.lock();
  impl_->shows_progress = show_progress;
  return impl_->estimate(seconds);
}

RunEstimate Trainer::fit_time(double seconds, bool show_progress) {
  const auto turn = impl_->context.lock();
  impl_->shows_progress = show_progress;
  return impl_->fit_time(seconds);
}

bool Trainer::step(std::int64_t count) { return impl_->run_steps(count); }

void Trainer::on_step(std::function<void(const TrainProgress&)> callback) {
  if (callback && impl_->busy) Impl::refuse_while_busy();
  const auto turn = impl_->context.lock();
  impl_->callback = std::move(callback);
}

void Trainer::stop() { impl_->asked.stop = true; }

EvaluationRow Trainer::evaluate() {
  Impl& self = *impl_;
  const auto turn = self.context.lock();
  if (self.test_views.empty()) {
    throw UsageError(fmt::format("The data set {} has no test views: set TrainOptions::test_every",
                                 self.dataset.root.string()));
  }
  if (!self.busy) self.begin_stepping();
  self.evaluate_views(true);
  return self.run.evaluations().back();
}

void Trainer::save() {
  Impl& self = *impl_;
  if (self.busy) {
    self.asked.save = true;
    return;
  }
  const auto turn = self.context.lock();
  self.begin_stepping();
  self.context.finish();
  self.save_model();
  self.save_checkpoint();
  self.write_metrics(self.iteration == last_iteration(self.options));
}

TrainLoss Trainer::loss() {
  Impl& self = *impl_;
  const auto turn = self.context.lock();
  if (!self.stepped) throw UsageError("There is no loss before the first step");
  const LastView last = self.last_view();
  return {last.loss.total, last.loss.psnr};
}

Gaussians Trainer::model() const {
  const auto turn = impl_->context.lock();
  return impl_->started ? impl_->model_to_show().download() : Gaussians();
}

const DeviceGaussians& Trainer::gaussians() const { return impl_->gaussians; }

void Trainer::set_command(std::string command) { impl_->command = std::move(command); }

void Trainer::set_watcher(RunWatcher* watcher) {
  const auto turn = impl_->context.lock();
  impl_->watcher = watcher;
}

std::int64_t Trainer::iteration() const { return impl_->iteration; }

std::int64_t Trainer::iterations() const { return last_iteration(impl_->options); }

}  // namespace raysplats
