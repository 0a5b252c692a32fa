// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>

#include "core/gaussian_selection.hpp"
#include "core/morton_order.hpp"
#include "train/memory_estimate.hpp"
#include "train/train_config.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

constexpr int kSmallPhoto = 200;         // longer side of photos that the start looks at, in pixels
constexpr std::size_t kMeanPhotos = 24;  // whose typical colour is the background

}  // namespace

const std::vector<SmallPhoto>& Trainer::Impl::photos() {
  if (small_photos.empty()) small_photos = load_small_photos(dataset, train_views, kSmallPhoto);
  return small_photos;
}

// What shows through where no Gaussian is. No photo says what lies there, and of all colours the
// typical one is the least wrong. The run's configuration names it from then on.
void Trainer::Impl::choose_background() {
  if (options.background != "auto" || cut_out) return;
  std::vector<std::size_t> some;
  const std::size_t count = std::min(kMeanPhotos, train_views.size());
  for (std::size_t i = 0; i < count; ++i)
    some.push_back(train_views[i * train_views.size() / count]);
  const std::array<float, 3> color = typical_color(
      small_photos.empty() ? load_small_photos(dataset, some, kSmallPhoto) : small_photos);
  options.background = fmt::format("{:.4f},{:.4f},{:.4f}", color[0], color[1], color[2]);
  background = background_color(options, cut_out);
}

// The most Gaussians of this run.
std::size_t Trainer::Impl::limit() {
  if (options.max_gaussians > 0) return static_cast<std::size_t>(options.max_gaussians);
  double pixels = 0;
  for (const Camera& camera : train_cameras) pixels += static_cast<double>(pixels_of(camera));
  pixels /= static_cast<double>(train_cameras.size());
  if (cut_out) pixels *= opaque_share(photos());
  const MemoryDemand demand{fitted_limit(pixels, options.iterations), largest_photo(),
                            train_views.size(), ray_views(), tracer.triangles()};
  return std::max<std::size_t>(1, gaussians_that_fit(options, demand, context.device()));
}

std::size_t Trainer::Impl::largest_photo() const {
  std::size_t pixels = 0;
  for (const Camera& camera : train_cameras) pixels = std::max(pixels, pixels_of(camera));
  return pixels;
}

std::size_t Trainer::Impl::ray_views() const {
  return static_cast<std::size_t>(
      std::count_if(train_cameras.begin(), train_cameras.end(),
                    [this](const Camera& camera) { return tracer.by_rays(camera); }));
}

// Makes the first model, unless resume() has brought one.
void Trainer::Impl::start() {
  if (!continues && !overwrite) check_no_run(run.path());
  const std::size_t most = limit();
  density.set_limit(most);
  if (started) {
    if (overwrite) run.remove_after(continues ? iteration : 0);
    run.begin_metrics(iteration);
  } else {
    Gaussians model = initial_model(
        dataset, train_cameras, [this]() -> const auto& { return photos(); }, most, options);
    if (model.size() == 0) throw UsageError("The first model has no Gaussians: use --init random");
    const std::vector<std::uint32_t> along_curve = morton_order(model.means);
    gaussians =
        DeviceGaussians::upload(context, gathered(model, along_curve), options.scale_activation);
    adam.initialize(gaussians.count, gaussians.sh_degree);
    footprint.update(gaussians);
    choose_background();
    if (overwrite) run.remove_after(0);
    run.begin_metrics(0);
    started = true;
    whole = true;
  }
  small_photos = {};
  const bool grows = density.accumulates_at(iteration);
  check_memory(options,
               {grows ? std::max(gaussians.count, most) : gaussians.count, largest_photo(),
                train_views.size(), ray_views(), tracer.triangles()},
               context.device());
  if (const std::size_t by_rays = ray_views(); by_rays > 0) {
    spdlog::info("{} of {} training views are traced ray by ray: {}", by_rays, train_cameras.size(),
                 !options.mirrors.empty() ? "there are mirrors in the scene"
                 : options.trace.traversal == Traversal::kBvh
                     ? "traversal is bvh"
                     : "as tuned for the device, or their cameras have no tiles");
  }
  run.write_config(options);
  run.write_cameras(train_cameras);
  // From here on what is in the folder is of this run.
  continues = true;
  overwrite = false;
}

}  // namespace raysplats
