// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <cmath>

#include "train/step_options.hpp"
#include "train/train_config.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

// Then poses stay, so that the model settles on them; shares of the run.
constexpr double kPoseShare = 0.8;

std::int64_t pose_end(const TrainOptions& options) {
  return std::llround(kPoseShare * static_cast<double>(options.iterations));
}

}  // namespace

// One view: forward, loss, backward, statistics, Adam. Nothing is waited for, but sizes where
// await_sizes says so and, where poses are trained, their gradients: then sizes as well, because
// what the host does of a step cannot be turned off by the device.
void Trainer::Impl::enqueue_step() {
  const std::size_t view = order.at(iteration);
  targets.prefetch(order.upcoming(kReadAhead - 1));
  const int divisor = resolution_divisor(options, iteration);
  const bool slopes = poses && iteration < pose_end(options);
  const Camera full = poses ? poses->camera(view) : train_cameras[view];
  const Camera camera = divisor > 1 ? downscaled(full, divisor) : full;
  const std::array<float, 3> behind = step_background(options, cut_out, background, iteration);
  gaussians.active_sh_degree = active_sh_degree(options, iteration);
  tracer.set_background(behind);
  tracer.forward(gaussians, camera, true,
                 await_sizes || slopes ? ViewSizes::kAwaited : ViewSizes::kAhead);
  const Buffer<float>& shown =
      exposure ? exposure->apply(tracer.image(), view, camera.width, camera.height)
               : tracer.image();
  loss.evaluate(shown, targets.get(view, camera.width, camera.height), cut_out, behind,
                camera.width, camera.height, image_gradient);
  guard.check_loss(loss.partials(), tracer.overflow());
  if (exposure) {
    whole = false;
    exposure->step(tracer.image(), image_gradient, view, camera.width, camera.height,
                   learning_rate(options.exposure_lr, options, iteration), guard.mark());
  }
  PoseGradient slope;
  tracer.backward(gaussians, image_gradient, gradients, slopes ? &slope : nullptr);
  whole = false;
  if (slopes) poses->step(view, slope, learning_rate(options.pose_lr, options, iteration));
  if (density.accumulates_at(iteration)) density.accumulate(gaussians, gradients, &guard.mark());
  if (mcmc) mcmc->press(gaussians, gradients, guard.mark());
  const bool measured = density.measures_step(iteration);
  if (measured) density.begin_step(gaussians);
  adam.step(gaussians, gradients, adam_rates_of(options, extent, iteration), &guard.mark());
  if (measured) density.end_step(gaussians, guard.mark());
  if (mcmc) mcmc->disturb(gaussians, iteration, guard.mark());
  footprint.apply(gaussians, guard.mark());
  guard.close(adam.refused(), tracer.kept_capped_rays(), gaussians.count);
  traced_rays += pixels_of(camera);
  ++iteration;
  whole = true;
  stepped = true;
}

// What happens between this step and the next one: density control.
void Trainer::Impl::control_density() {
  // Means move on after the last pass, and with them the least sizes.
  if (density.idles_at(iteration)) {
    settle();
    footprint.update(gaussians);
  }
  const bool refines = density.refines_at(iteration);
  const bool resets = density.resets_at(iteration);
  if (!refines && !resets) return;
  settle();
  check_guard();
  whole = false;
  if (refines) {
    const DensityPlan plan = density.refine(gaussians, iteration);
    follow_plan(plan);
    spdlog::debug("iteration {}: {} cloned, {} split, {} pruned, {} refused, {} Gaussians",
                  iteration, plan.cloned, plan.split, plan.pruned, plan.refused, gaussians.count);
  }
  if (resets) {
    density.reset_opacities(gaussians);
    adam.reset(ParameterGroup::kOpacities);
  }
  whole = true;
}

// Optimiser and least sizes follow the new set of Gaussians.
void Trainer::Impl::follow_plan(const DensityPlan& plan) {
  if (plan.changes()) {
    const std::vector<std::uint32_t> source =
        options.densify_inherit ? plan.source : plan.state_source();
    Buffer<std::uint32_t> device_source(context, source.size(), "state sources");
    device_source.upload(source);
    adam.remap(device_source, gaussians.count);
  }
  footprint.update(gaussians);
}

}  // namespace raysplats
