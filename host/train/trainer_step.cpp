// SPDX-License-Identifier: Apache-2.0
#include <spdlog/spdlog.h>

#include <cmath>

#include "run/train_config.hpp"
#include "scene/image/pixel_count.hpp"
#include "train/step_options.hpp"
#include "train/trainer_impl.hpp"

namespace raysplats {
namespace {

// Then poses stay, so that the model settles on them; shares of the run.
constexpr double kPoseShare = 0.8;

std::int64_t pose_end(const TrainOptions& options) {
  return std::llround(kPoseShare * static_cast<double>(options.iterations));
}

}  // namespace

// The gradient of one view of a step: forward, loss, backward. It changes nothing that the other
// views of the step see, so it does not matter where and in what order they are made. Nothing is
// waited for, but sizes where await_sizes says so and, where poses are trained, their gradients:
// then sizes as well, because what the host does of a step cannot be turned off by the device.
void Trainer::Impl::enqueue_view(std::size_t slot) {
  ViewSlot& out = slots[slot];
  const std::int64_t turn = turn_of(slot);
  const std::size_t view = out.view;
  read_ahead(turn);
  const int divisor = resolution_divisor(options, iteration);
  const bool trains_poses = poses && iteration < pose_end(options);
  const Camera full = poses ? poses->camera(view) : train_cameras[view];
  const Camera camera = divisor > 1 ? downscaled(full, divisor) : full;
  const std::array<float, 3> behind = step_background(options, cut_out, background, turn);
  if (!sky) tracer.set_background(behind);
  tracer.forward(gaussians, camera, true,
                 await_sizes || trains_poses ? ViewSizes::kAwaited : ViewSizes::kAhead);
  reflected_rays += tracer.reflected_rays();
  const Buffer<float>& shown =
      exposure ? exposure->apply(tracer.image(), view, behind, camera.width, camera.height)
               : tracer.image();
  const DevicePhoto photo = photo_cache.get(view, camera.width, camera.height);
  loss.evaluate(shown, photo, cut_out, behind, camera.width, camera.height, image_gradient);
  guard.check_view(loss.partials(), tracer.overflow(), tracer.capped_on_device(),
                   fit.place(view, divisor == 1), slot == share.first);
  if (exposure) {
    exposure->observe(tracer.image(), photo, behind, camera.width, camera.height, slot);
    exposure->backward(image_gradient, view, behind, camera.width, camera.height);
  }
  if (depths) {
    depths->backward({view, camera.width, camera.height}, tracer.image(), tracer.depth(), photo,
                     image_gradient);
  }
  tracer.backward(gaussians, image_gradient, gradients.gaussians,
                  trains_poses ? &out.pose_gradient : nullptr,
                  depths ? &depths->gradient() : nullptr);
  if (slots.size() == 1) return;
  if (sky) {
    const Buffer<float>& sky_gradient = tracer.sky()->gradient();
    gradients.sky.ensure(context, sky_gradient.size(), "sky gradient of a view");
    gradients.sky.copy_from(sky_gradient, sky_gradient.size());
  }
  sum.add(slot, gradients);
}

// The views of a step, those of this rank with their gradients.
void Trainer::Impl::enqueue_views() {
  sum.begin(ranks, slots.size(), gaussians);
  reflected_rays = 0;
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    slots[slot].view = order.at(turn_of(slot));
    if (share.holds(slot)) enqueue_view(slot);
  }
}

// All views of a step and what follows of them.
void Trainer::Impl::enqueue_step() {
  gaussians.active_sh_degree = active_sh_degree(options, iteration);
  do {
    enqueue_views();
  } while (!sum_views());
  const int divisor = resolution_divisor(options, iteration);
  const bool several = slots.size() > 1;
  whole = false;
  traced_rays += reflected_rays;
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    const ViewSlot& one = slots[slot];
    const Camera& full = train_cameras[one.view];
    traced_rays += pixel_count(divisor > 1 ? downscaled(full, divisor) : full);
    if (exposure) {
      exposure->step(one.view, slot, options.exposure_damping, guard.mark(),
                     iteration >= join_iteration());
    }
    if (poses && iteration < pose_end(options))
      poses->step(one.view, one.pose_gradient, learning_rate(options.pose_lr, options, iteration));
  }
  if (density.accumulates_at(iteration))
    density.accumulate(gaussians, gradients.gaussians, &guard.mark());
  if (sky) {
    sky->step(several ? gradients.sky : tracer.sky()->gradient(), tracer.sky()->coefficients(),
              color_share(options) * learning_rate(options.sky_lr, options, iteration),
              guard.mark());
  }
  GaussianGradients& summed = gradients.gaussians;
  if (mcmc) mcmc->add_regularisation(gaussians, summed, guard.mark());
  const bool measured = density.measures_step(iteration);
  if (measured) density.begin_step(gaussians);
  adam.step(gaussians, summed, adam_rates_of(options, extent, motion, iteration), &guard.mark());
  if (measured) density.end_step(gaussians, guard.mark());
  if (mcmc) mcmc->add_noise(gaussians, iteration, guard.mark());
  const double thickness = flat_thickness(options, iteration);
  footprint.apply(gaussians, guard.mark(), thickness);
  if (mean.add(options, gaussians, iteration + 1, guard.mark()))
    footprint.apply(mean.model(), guard.mark(), thickness);
  guard.close(adam.refused(), gaussians.count);
  ++iteration;
  whole = true;
  stepped = true;
  pass_due = density.acts_at(iteration);
}

// What happens between this step and the next one: density control. Where it is due all steps up to
// here are done before it, so that none of them is made again behind it.
void Trainer::Impl::control_density() {
  if (!pass_due) return;
  finish_steps();
  // Means move on after the last pass, and with them the least sizes.
  if (density.idles_at(iteration)) footprint.update(gaussians);
  if (density.changes_at(iteration)) {
    check_guard();
    whole = false;
    mean.restart(iteration);
    if (density.refines_at(iteration)) {
      check_ranks_agree();
      const DensityPlan plan = density.refine(gaussians, iteration);
      apply_plan(plan);
      spdlog::debug("iteration {}: {} cloned, {} split, {} pruned, {} refused, {} Gaussians",
                    iteration, plan.cloned, plan.split, plan.pruned, plan.refused, gaussians.count);
    }
    if (density.resets_at(iteration)) {
      density.reset_opacities(gaussians);
      adam.reset(ParameterGroup::kOpacities);
    }
    whole = true;
  }
  pass_due = false;
}

// Optimiser and least sizes follow the new set of Gaussians.
void Trainer::Impl::apply_plan(const DensityPlan& plan) {
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
