// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <set>
#include <utility>

#include "io/dataset/dataset_photos.hpp"
#include "io/dataset/dataset_views.hpp"
#include "run/former_metrics.hpp"
#include "run/train_config.hpp"
#include "scene/even_choice.hpp"
#include "scene/gaussians/gaussian_selection.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/morton_order.hpp"
#include "train/memory_estimate.hpp"
#include "train/start/capture_warnings.hpp"
#include "train/start/flat_start.hpp"
#include "train/start/mask_check.hpp"
#include "train/start/still_marks.hpp"
#include "train/step_options.hpp"
#include "train/trainer_impl.hpp"
#include "train/unused_options.hpp"
#include "util/file_kind.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

constexpr int kSmallPhoto = 200;         // longer side of photos that the start looks at, in pixels
constexpr std::size_t kFewViews = 3;     // below, photos say next to nothing of depth
constexpr std::size_t kFewPhotos = 30;   // up to so many are known by heart in long runs
constexpr std::int64_t kLongRun = 2;     // times as long as they ask for
constexpr double kSigmoidExtent = 20;    // then one unit is less than 0.05 extents, a usual limit
constexpr double kPosePrior = 1;         // PoseRefinement: what errors of half a degree can bear
constexpr std::size_t kSomePhotos = 24;  // that tell what is typical of all
constexpr std::size_t kManyPhotos = 100;  // that tell of depth
constexpr double kLeastShown = 0.01;      // of the photos, for a start to be without a reason

std::vector<std::size_t> evenly_spread(const std::vector<std::size_t>& all, std::size_t most) {
  std::vector<std::size_t> out = even_choice(all.size(), most);
  for (std::size_t& i : out) i = all[i];
  return out;
}

// A length is the user's to choose, and that of a run by time nobody knows beforehand.
void note_many_passes(const TrainOptions& options, std::size_t photos) {
  const std::int64_t asked = usual_length(photos);
  const std::int64_t views = last_iteration(options) * options.views_per_step;
  if (photos > kFewPhotos || views <= kLongRun * asked) return;
  spdlog::info(
      "{} of few photos show each of {} {} times: models learn them by heart and get worse between "
      "them; without -n and --time a run has {}",
      counted(last_iteration(options), "iteration"), photos,
      views / static_cast<std::int64_t>(photos), asked);
}

// `order`: of the run's views, a copy that moves on.
void note_unseen(const TrainOptions& options, std::size_t photos, ViewOrder order) {
  const std::int64_t views = last_iteration(options) * options.views_per_step;
  std::set<std::size_t> seen;
  for (std::int64_t turn = 0; turn < views && seen.size() < photos; ++turn)
    seen.insert(order.at(turn));
  const std::size_t unseen = photos - seen.size();
  if (unseen == 0) return;
  spdlog::info("within {} the run never looks at {} of the {} training photos",
               counted(last_iteration(options), "iteration"), unseen, photos);
}

// `shown`: the share of the photos that counts.
[[noreturn]] void refuse_transparent(double shown) {
  throw UsageError(fmt::format(
      "The first model has no Gaussians, because masks, areas or transparent pixels leave {:.2g} % "
      "of the photos: give masks that are white where photos count",
      100 * shown));
}

// Iterations that were asked for by their number and that the run does not reach.
void warn_of_late(const char* option,
                  const std::vector<RunShare>& moments,
                  const TrainOptions& options) {
  for (const RunShare& moment : moments) {
    if (moment.value < 1 || moment.of(options.iterations) <= last_iteration(options)) continue;
    spdlog::warn("{} = {} is beyond the {} of the run: nothing happens then", option, moment.value,
                 counted(last_iteration(options), "iteration"));
  }
}

// Options that were asked for and change nothing.
void warn_of_idle_options(const TrainOptions& options) {
  if (const std::string unused = unused_options(options); !unused.empty())
    spdlog::warn("these options change nothing of this run: {}", unused);
  const std::int64_t from = options.densify_from.of(options.iterations);
  const std::int64_t until = options.densify_until.of(options.iterations);
  if (until == 0 || from <= until) return;
  spdlog::warn(
      "densify-from = {} is later than densify-until = {}: the number of Gaussians never grows",
      options.densify_from.value, options.densify_until.value);
}

}  // namespace

const std::vector<SmallPhoto>& Trainer::Impl::photos(PhotoChoice choice) {
  const std::vector<std::size_t> views = first_views();
  const std::size_t most = choice == PhotoChoice::kSome   ? kSomePhotos
                           : choice == PhotoChoice::kMany ? kManyPhotos
                                                          : views.size();
  std::vector<SmallPhoto>& out = small_photos[std::min(most, views.size())];
  if (out.empty()) out = reduced_photos(evenly_spread(views, most));
  return out;
}

std::vector<SmallPhoto> Trainer::Impl::reduced_photos(std::span<const std::size_t> views) const {
  std::vector<SmallPhoto> out =
      load_small_photos(dataset, views, kSmallPhoto, {shows_progress ? stderr : nullptr});
  if (exposure) balance(out);
  return out;
}

// Training views that may be looked at from the beginning: all but the validation views.
std::vector<std::size_t> Trainer::Impl::first_views() const {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < train_views.size(); ++i) {
    if (!std::binary_search(apart.begin(), apart.end(), i)) out.push_back(train_views[i]);
  }
  return out;
}

// Colours of photos that nothing has been learned of, where they are found.
void Trainer::Impl::reset_exposure() {
  if (options.exposure) exposure.emplace(context, train_views.size(), slots.size(), cut_out, apart);
}

// A sky that nothing has been learned of.
void Trainer::Impl::reset_sky() {
  const SkyLight light = trace_options_of(options, background).sky;
  if (light.empty()) return;
  tracer.set_background({}, light);
  sky.emplace(context, 3 * light.size());
}

// Poses as the data set has them, where they are trained.
void Trainer::Impl::reset_poses() {
  if (!options.poses) return;
  poses.emplace(train_cameras, extent, subject_distances(train_cameras, dataset.points, extent),
                kPosePrior, apart);
}

// What shows through where no Gaussian is. No photo says what lies there, and of all colours the
// typical one is the least wrong. The run's configuration names it from then on, and a sky begins
// with it.
void Trainer::Impl::choose_background() {
  if ((options.background != "auto" && !sky) || cut_out) return;
  const std::array<float, 3> color = typical_color(photos(PhotoChoice::kSome));
  if (sky) {
    tracer.set_background({}, even_sky(options.sky_degree, color));
    return;
  }
  options.background = fmt::format("{:.4f},{:.4f},{:.4f}", color[0], color[1], color[2]);
  background = background_color(options, cut_out);
}

// The run's configuration names it from then on.
void Trainer::Impl::choose_color_range() {
  if (options.color_range == 0) options.color_range = color_range(photos(PhotoChoice::kSome));
}

// The number of the view of a slot of the next step among all that steps take.
std::int64_t Trainer::Impl::turn_of(std::size_t slot) const {
  return iteration * options.views_per_step + static_cast<std::int64_t>(slot);
}

// The last view's number among all that steps have taken so far.
std::int64_t Trainer::Impl::last_turn() const { return iteration * options.views_per_step - 1; }

// The most Gaussians of a run of these photos.
std::size_t Trainer::Impl::most_gaussians(std::int64_t iterations) {
  if (options.max_gaussians > 0) return static_cast<std::size_t>(options.max_gaussians);
  double pixels = 0;
  for (const Camera& camera : train_cameras) pixels += static_cast<double>(pixel_count(camera));
  pixels /= static_cast<double>(train_cameras.size());
  if (cut_out) pixels *= body_share(photos(PhotoChoice::kAll));
  const std::size_t fitting =
      gaussians_that_fit(options, demand(fitted_limit(pixels, iterations)), context.device());
  return std::max<std::size_t>(1, ranks.all_reduce_min(fitting));
}

// What a run of these photos wants to hold of the device with so many Gaussians.
MemoryDemand Trainer::Impl::demand(std::size_t count) const {
  return {count,
          largest_photo(),
          train_views.size(),
          ray_views(),
          tracer.triangles(),
          photo_words(),
          depths ? depths->maps() : 0};
}

// Refuses a run for which the device has too little memory, that has `count` Gaussians and may grow
// to `most`.
void Trainer::Impl::check_room(std::size_t count, std::size_t most) const {
  const bool grows = density.accumulates_at(iteration);
  check_memory(options, demand(grows ? std::max(count, most) : count), context.device());
}

std::size_t Trainer::Impl::largest_photo() const {
  std::size_t pixels = 0;
  for (const Camera& camera : train_cameras) pixels = std::max(pixels, pixel_count(camera));
  return pixels;
}

// 32-bit words per pixel of the most precise photo.
std::size_t Trainer::Impl::photo_words() const {
  std::size_t words = 1;
  for (const std::size_t i : train_views) {
    const View& view = dataset.views[i];
    words =
        std::max(words, static_cast<std::size_t>(view.sample_bytes + (view.mask_apart ? 1 : 0)));
  }
  return words;
}

std::size_t Trainer::Impl::ray_views(int divisor) const {
  return static_cast<std::size_t>(
      std::count_if(train_cameras.begin(), train_cameras.end(), [&](const Camera& camera) {
        return tracer.by_rays(divisor > 1 ? downscaled(camera, divisor) : camera);
      }));
}

// Refuses views without gradients of depths, which are known in packets alone. Panoramas have none
// where they are small.
void Trainer::Impl::require_depth_gradients() const {
  if (ray_views() > 0) {
    throw UsageError(
        "The option 'depth-weight' is for views that are traced in packets: choose 'traversal' = "
        "auto or tiles, and cameras with a centre (panoramas of some size)");
  }
  for (const ResolutionStep& step : options.resolution_schedule) {
    const std::size_t by_rays = ray_views(step.divisor);
    if (by_rays == 0) continue;
    throw UsageError(fmt::format(
        "The option 'depth-weight' is for views that are traced in packets, and {} of {} are not "
        "where 'resolution-schedule' makes them {} times smaller: choose 'resolution-schedule' = "
        "[], which is full size from the beginning, or smaller divisors",
        by_rays, train_cameras.size(), step.divisor));
  }
}

// What photos that were read for the start tell of faults of the capture: as many as there are.
void Trainer::Impl::warn_of_photos() {
  const auto warn = [this](std::string warning) {
    if (warning.empty()) return;
    spdlog::warn("{}", warning);
    photo_warnings.push_back(std::move(warning));
  };
  if (small_photos.empty()) photos(PhotoChoice::kSome);
  const auto& [count, read] = *small_photos.rbegin();
  const std::vector<std::size_t> all = first_views();
  const std::vector<std::size_t> views = evenly_spread(all, count);
  warn(grey_warning(read, all.size()));
  const std::vector<std::size_t> marked = evenly_spread(all, kMarkPhotos);
  warn(marks_warning(
      dataset, photos_for_marks(dataset, marked, {shows_progress ? stderr : nullptr}), marked));
  warn(masks_warning(dataset, masked_out(dataset, read, views, options.seed)));
}

// A model to start from, with at most that many Gaussians. Points in random places need no photo
// that shows them, but training does. Some photos tell that as a rule, without the others.
Gaussians Trainer::Impl::new_model(std::size_t most) {
  check_room(0, most);
  if (cut_out && !shows_anything(photos(PhotoChoice::kSome)) &&
      !shows_anything(photos(PhotoChoice::kAll))) {
    refuse_transparent(0);
  }
  Gaussians model = initial_model(
      dataset, train_cameras, [this](PhotoChoice choice) -> const auto& { return photos(choice); },
      most, options, !std::exchange(poses_checked, true));
  if (model.size() > 0) return model;
  if (options.bounds)
    throw UsageError("No Gaussian of the start lies within --bounds: give a larger box");
  const std::vector<SmallPhoto>& all = photos(PhotoChoice::kAll);
  const double shown = cut_out ? body_share(all) : opaque_share(all);
  if (shown < kLeastShown) refuse_transparent(shown);
  throw UsageError("The first model has no Gaussians: use --init random");
}

// Before the folder of a new run is made: what keeps the model from being made leaves none behind.
// A folder that is there may be another run's, which is found out when it is locked.
void Trainer::Impl::make_first_model() {
  if (started || first_model || ranks.broadcast_value(0, is_folder(run.path()))) return;
  first_model = new_model(limit());
}

// The first model on the device, with at most that many Gaussians.
void Trainer::Impl::upload_first_model(std::size_t most) {
  Gaussians model = first_model ? std::move(*first_model) : new_model(most);
  first_model.reset();
  check_room(model.size(), most);
  if (options.flat) face_cameras(model, train_cameras);
  motion = static_cast<float>(motion_extent(train_cameras, extent, model.means));
  spdlog::debug("means move in units of {:.4g}, the cameras' extent is {:.4g}", motion, extent);
  gaussians = DeviceGaussians::upload(context, gathered(model, morton_order(model.means)),
                                      options.scale_activation);
  adam.initialize(gaussians.count, gaussians.sh_degree);
  footprint.update(gaussians);
}

// What the run has said of itself before resume(), once: what this object says later is in the
// folder as well.
void Trainer::Impl::load_former_metrics() {
  if (former) return;
  former = run.former_metrics();
  clock.evaluating.set(former_number(*former, "evaluation_seconds"));
  if (photo_warnings.empty()) photo_warnings = former_warnings(*former);
  const TrainOptions& before = resumed ? *resumed : options;
  for (const TrainRow& row : run.former_rows()) {
    last_loss = row.loss;
    rise.note(order.at(row.iteration * options.views_per_step - 1),
              resolution_divisor(before, row.iteration - 1), row.psnr);
  }
}

// Makes the first model, unless resume() has brought one. What another run left in the folder is
// removed when nothing refuses this one any more.
void Trainer::Impl::start() {
  if (!continues && !overwrite && ranks.leads()) check_no_run(run.path());
  const std::size_t most = limit();
  density.set_limit(most);
  if (started) {
    check_room(gaussians.count, most);
  } else {
    upload_first_model(most);
    choose_background();
    choose_color_range();
    if (ranks.leads()) warn_of_photos();
  }
  small_photos.clear();
  if (train_views.size() < kFewViews) {
    spdlog::warn("{} of {}: depth is open, and other views will look wrong",
                 counted(train_views.size(), "training view"), dataset.root.string());
  }
  const std::vector<Camera> held_out = cameras_of(dataset, test_views);
  camera_warnings = {strays_warning(train_cameras),
                     direction_warning(dataset, held_out, train_cameras),
                     crowds_warning(crowded, train_cameras, held_out)};
  std::erase(camera_warnings, "");
  for (const std::string& warning : camera_warnings) spdlog::warn("{}", warning);
  note_many_passes(options, train_views.size());
  note_unseen(options, train_views.size(), order);
  warn_of_late("eval-at", options.eval_at, options);
  warn_of_late("save-at", options.save_at, options);
  warn_of_idle_options(options);
  warn_of_late_look();
  if (options.scale_activation == ScaleActivation::kSigmoid && extent > kSigmoidExtent) {
    spdlog::warn(
        "scale-activation = sigmoid keeps every axis below one unit of the data set, {:.2g} of the "
        "scene's extent of {:.3g}: what is larger cannot be shown by one Gaussian; use exp, or a "
        "data set in units of which the extent has a few",
        1.0 / extent, extent);
  }
  if (test_views.empty()) {
    const bool by_option =
        (options.data.test_every == 0 || options.data.test_list) && dataset.views.size() > 1;
    spdlog::info("no view is held out, so nothing is measured{}",
                 by_option ? ": --test-every 8 holds some out" : "");
  }
  if (const std::size_t by_rays = ray_views(); by_rays > 0) {
    spdlog::info("{} of {} training views are traced ray by ray: {}", by_rays, train_cameras.size(),
                 !options.mirrors.empty() ? "there are mirrors in the scene"
                 : options.trace.traversal == Traversal::kBvh
                     ? "traversal is bvh"
                     : "as tuned for the device, or their cameras have no tiles");
  }
  check_ranks_agree();
  started = whole = true;
  if (overwrite) {
    run.remove_after(continues ? iteration : 0);
    ranks.barrier();  // nobody reads what another run has said
  }
  run.begin_metrics(iteration);
  load_former_metrics();
  run.write_config(options);
  run.write_cameras(train_cameras);
  // From here on what is in the folder is of this run.
  continues = true;
  overwrite = false;
}

}  // namespace raysplats
