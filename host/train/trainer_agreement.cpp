// SPDX-License-Identifier: Apache-2.0
// Training photos that contradict those from beside them: a wrong pose, the wrong side of a folded
// reconstruction, a finger before the lens. A model that tries to show them too shows all others
// worse.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "eval/photo_agreement.hpp"
#include "scene/camera/view_axes.hpp"
#include "train/schedule.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

// Of the error of a picture, what no fit of its colours takes off.
constexpr double kLeastError = 0.01;
constexpr double kLeastVariance = 1e-8;  // of the colours of a photo
constexpr std::size_t kNamed = 8;

}  // namespace

void Trainer::Impl::order_views() {
  order = ViewOrder(options.seed, train_views.size(), apart,
                    join_iteration() * options.views_per_step, crowded);
  if (!left_out.empty()) order.leave_out(left_out, left_out_from * options.views_per_step);
}

// Compares the model with the photos that it is trained on, but for their colours: exposure is no
// contradiction.
std::vector<std::size_t> Trainer::Impl::odd_views() {
  Exposure colors(context, 1, 1, cut_out);
  std::vector<PlacedPhoto> photos;
  std::vector<std::size_t> views;
  if (!sky) tracer.set_background(background);
  for (std::size_t view = 0; view < train_views.size(); ++view) {
    if (iteration < join_iteration() && std::binary_search(apart.begin(), apart.end(), view))
      continue;
    const Camera& full = train_cameras[view];
    const Camera camera = compared_camera(full);
    const int width = camera.width, height = camera.height;
    tracer.forward(gaussians, camera, false, ViewSizes::kAwaited);
    const Buffer<float>& shown =
        exposure ? exposure->apply(tracer.image(), view, background, width, height)
                 : tracer.image();
    const DevicePhoto photo = photo_cache.get(view, width, height);
    loss.evaluate(shown, photo, cut_out, background, width, height, image_gradient);
    colors.observe(shown, photo, background, width, height);
    const double error = std::pow(10.0, -loss.value().psnr / 10.0);
    if (!std::isfinite(error) || !(error > 0)) continue;  // nothing of it counts, or it is equal
    const Exposure::Tale tale = colors.tale(error);
    const double left = std::max(error - tale.removable, kLeastError * error);
    PlacedPhoto placed;
    placed.psnr = -10.0 * std::log10(left);
    placed.contrast = 10.0 * std::log10(std::max(tale.variance, kLeastVariance));
    placed.center = full.center();
    if (full.model != CameraModel::kEquirectangular) placed.direction = view_axis(full);
    photos.push_back(placed);
    views.push_back(view);
  }
  std::vector<std::size_t> out;
  for (const std::size_t photo : photos_to_leave_out(photos)) out.push_back(views[photo]);
  return out;
}

// All ranks do what the first one finds. What contradicts the others no longer, since those that
// spoilt the model there are gone, is trained on again.
void Trainer::Impl::leave_out_odd_views() {
  finish_steps();
  std::vector<std::size_t> found;
  if (ranks.leads()) found = odd_views();
  found.resize(ranks.broadcast_value(0, found.size()));
  ranks.broadcast(std::as_writable_bytes(std::span(found)));
  if (found != left_out) {
    spdlog::debug("iteration {}: {} of {} training photos contradict those from beside them",
                  iteration, found.size(), train_views.size());
    left_out = std::move(found);
    left_out_from = left_out.empty() ? 0 : iteration;
    order_views();
  }
  const double last = judged_shares(options, loss_views()).back();
  const bool more = iteration < std::llround(last * static_cast<double>(options.iterations));
  if (left_out.empty() || more || !ranks.leads()) return;
  std::vector<std::string> names;
  for (const std::size_t view : left_out) {
    if (names.size() == kNamed) break;
    names.push_back(train_cameras[view].name);
  }
  spdlog::warn(
      "{} of {} training photos contradict those from beside them, as by a wrong pose or because "
      "something has moved, and are left out (--no-leave-out-odd keeps them): {}{}",
      left_out.size(), train_views.size(), fmt::join(names, ", "),
      left_out.size() > kNamed ? fmt::format(" and {} more", left_out.size() - kNamed) : "");
}

void Trainer::Impl::store_left_out(Checkpoint& checkpoint, CheckpointSections& sections) const {
  if (left_out.empty()) return;
  checkpoint.left_out_from = left_out_from;
  sections["left_out"] = [this] { return std::vector<float>(left_out.begin(), left_out.end()); };
}

// A run that is told to keep them from here on has them back.
void Trainer::Impl::restore_left_out(const Checkpoint& checkpoint) {
  left_out.clear();
  left_out_from = 0;
  const auto found = checkpoint.sections.find("left_out");
  if (found != checkpoint.sections.end() && options.leave_out_odd) {
    for (const float view : found->second) {
      const double least = left_out.empty() ? 0 : static_cast<double>(left_out.back()) + 1;
      if (!(view >= least && view < static_cast<double>(train_views.size()))) {
        throw DataError(
            "The checkpoint leaves out photos that its run does not have: resume from another one");
      }
      left_out.push_back(static_cast<std::size_t>(view));
    }
    left_out_from = checkpoint.left_out_from;
  }
  order_views();
}

}  // namespace raysplats
