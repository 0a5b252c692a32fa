// SPDX-License-Identifier: Apache-2.0
#include "bench/scene_state.hpp"
#include "parallel/work.h"
#include "scene/options/trace_option_table.hpp"
#include "trace/work.h"
#include "train/schedule.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::uint64_t kKeyStream = 4;
constexpr int kSortPasses = 4;

}  // namespace

BenchOperation SceneBench::Impl::bounds() {
  return {[this] { boxes(); },
          {},
          [this] {
            const DeviceGaussians& g = gaussians();
            bounds_kernel->compute(g.means, g.quaternions, g.scales, g.opacities, g.count,
                                   options.trace.quantile, box_buffer);
          },
          {{"bounds", {}, false, [this] { return bounds_work(); }}}};
}

BenchOperation SceneBench::Impl::sort() {
  return {[this] {
            sorter.emplace(context);
            CounterRng random(options.seed, kKeyStream);
            std::vector<std::uint32_t> words(count());
            for (std::uint32_t& word : words) word = static_cast<std::uint32_t>(random.bits());
            for (Buffer<std::uint32_t>* buffer : {&unsorted, &keys, &values}) {
              buffer->ensure(context, count(), "benchmark keys");
            }
            unsorted.upload(words);
            values.clear();
          },
          [this] { keys.copy_from(unsorted, count()); },
          [this] { sorter->sort(keys, values, count()); },
          {{"sort", {}, false, [this] {
              const double n = gaussians_count();
              return BenchWork{{{"pairs", n}}, kSortPasses * RS_WORK_SORT_PASS_BYTES * n, 0};
            }}}};
}

// What RayTracer needs before its first ray, of a model as commands load it (in_morton_order).
BenchOperation SceneBench::Impl::build() {
  return {[this] {
            rays_tracer();
            gaussians();
          },
          {},
          [this] { ray_tracer->update(gaussians()); },
          {{"order",
            {"bvh/curve.cl", "bvh/leaf_order.cl", "bvh/leaf_order_group.cl", "parallel/"},
            false,
            [this] { return order_work(); }},
           {"nodes", {"trace/ray_tree.cl", "bvh/lbvh.cl"}, false, [this] { return nodes_work(); }},
           {"build", {}, false, [this] {
              return together(order_work(), together(bounds_work(), nodes_work()));
            }}}};
}

BenchOperation SceneBench::Impl::refit() {
  return {[this] { rays_tracer().update(gaussians()); },
          {},
          [this] { ray_tracer->refit(gaussians()); },
          {{"refit", {}, false, [this] { return together(bounds_work(), nodes_work()); }}}};
}

BenchOperation SceneBench::Impl::view() {
  return {[this] {
            tracer().forward(gaussians(), model.camera);
            view_statistics = tracer().statistics();
          },
          {},
          [this] { tracer().forward(gaussians(), model.camera); },
          {{"prepare-view", {"trace/prepare_view.cl"}, false, [this] { return prepare_work(); }},
           {"tile-lists",
            {"trace/tile_lists.cl", "trace/view_sizes.cl:admit", "parallel/"},
            false,
            [this] { return lists_work(); }},
           {"forward",
            {"trace/camera_forward.cl", "trace/group_forward.cl"},
            false,
            [this] { return forward_work(view_statistics); }},
           {"view", {}, false, [this] {
              return together(forward_work(view_statistics),
                              together(prepare_work(), lists_work()));
            }}}};
}

BenchOperation SceneBench::Impl::view_by_bvh() {
  return {[this] { view_tracer(); },
          {},
          [this] { view_tracer().forward(gaussians(), model.camera); },
          {{"view-bvh", {}, false, [this] {
              return BenchWork{{{"rays", pixels()}}, RS_WORK_RAY_BYTES * pixels(), 0};
            }}}};
}

BenchOperation SceneBench::Impl::backward() {
  return {[this] {
            make_loss();
            forward_with_hits();
            image_loss->evaluate(picture, {photo}, false, {0, 0, 0}, model.camera.width,
                                 model.camera.height, image_gradient);
          },
          {},
          [this] { tracer().backward(gaussians(), image_gradient, gradients); },
          {{"backward",
            {"trace/camera_backward.cl", "trace/stream_segments.cl", "trace/group_backward.cl",
             ":(fill)"},
            false,
            [this] { return backward_work(kept_statistics); }},
           {"finalize", {"trace/finalize_gradients.cl", "trace/group_finalize.cl"}, false, [this] {
              return finalize_work();
            }}}};
}

BenchOperation SceneBench::Impl::packets(PacketShape shape) {
  const std::string name = packet_shape_name(shape);
  return {[this, shape] {
            make_loss();
            TraceOptions trace = options.trace;
            trace.packet_shape = shape;
            if (options.trace.packet_shape != shape) trace.packet_width = 0;
            shaped_tracer.reset();
            shaped_tracer = std::make_unique<CameraTracer>(context, trace);
            shaped_tracer->update(gaussians());
            shaped_tracer->forward(gaussians(), model.camera, true);
            shaped_statistics = shaped_tracer->statistics();
            image_loss->evaluate(picture, {photo}, false, {0, 0, 0}, model.camera.width,
                                 model.camera.height, image_gradient);
            shaped_tracer->backward(gaussians(), image_gradient, gradients);
          },
          {},
          [this] {
            shaped_tracer->forward(gaussians(), model.camera, true);
            shaped_tracer->backward(gaussians(), image_gradient, gradients);
          },
          {{"forward-" + name,
            {"trace/camera_forward.cl", "trace/group_forward.cl"},
            false,
            [this] { return forward_work(shaped_statistics); }},
           {"backward-" + name,
            {"trace/camera_backward.cl", "trace/stream_segments.cl", "trace/group_backward.cl",
             ":(fill)"},
            false,
            [this] { return backward_work(shaped_statistics); }}},
          true};
}

BenchOperation SceneBench::Impl::rays() {
  return {[this] {
            rays_tracer().update(gaussians());
            make_rays();
          },
          {},
          [this] { ray_results = ray_tracer->trace(gaussians(), ray_list); },
          {{"rays", {}, false, [this] { return rays_work(); }}}};
}

BenchOperation SceneBench::Impl::loss() {
  return {[this] { make_loss(); },
          {},
          [this] {
            image_loss->evaluate(picture, {photo}, false, {0, 0, 0}, model.camera.width,
                                 model.camera.height, image_gradient);
            image_loss->value();
          },
          {{"loss-value",
            {"train/loss_prepare.cl", "train/loss_ssim.cl:ssim_derivatives",
             "train/group_loss.cl:group_ssim_derivatives", "train/loss_reduce.cl"},
            false,
            [this] { return loss_value_work(); }},
           {"loss-gradient",
            {"train/loss_ssim.cl:loss_gradient", "train/group_loss.cl:group_gradient"},
            false,
            [this] { return loss_gradient_work(); }}}};
}

// Rates of zero leave the model as it is, so that every repetition does the same work.
BenchOperation SceneBench::Impl::adam_step() {
  return {[this] { make_gradients(); },
          {},
          [this] { adam->step(gaussians(), gradients, AdamRates{}); },
          {{"adam", {}, false, [this] { return adam_work(); }}}};
}

// The second sample of a run's mean, told again and again.
BenchOperation SceneBench::Impl::mean_sample() {
  TrainOptions run;
  run.iterations = 1000;
  const std::int64_t first = mean_from(run) + 1;
  return {[this, run, first] {
            open_guard = Buffer<std::uint32_t>(context, 1, "open guard");
            open_guard.clear();
            mean.emplace(context);
            mean->add(run, gaussians(), first, open_guard);
          },
          {},
          [this, run, first] { mean->add(run, gaussians(), first + 1, open_guard); },
          {{"mean", {}, false, [this] { return mean_work(); }}}};
}

BenchOperation SceneBench::Impl::density_statistics() {
  return {[this] {
            make_gradients();
            make_density();
          },
          {},
          [this] { density->accumulate(gaussians(), gradients); },
          {{"density-sums", {}, false, [this] { return statistics_work(); }}}};
}

BenchOperation SceneBench::Impl::densify() {
  return {[this] { make_density(); },
          [this] {
            densified = copy_of_gaussians();
            density->restore_statistics(density_signal);
          },
          [this] {
            density->refine(densified, 1);
            densified_count = densified.count;
          },
          {{"densify", {}, true, [this] { return densify_work(); }}}};
}

BenchOperation SceneBench::Impl::iteration() {
  return {[this] {
            make_loss();
            make_gradients();
            make_density();
            density->restore_statistics({});
            forward_with_hits();
          },
          {},
          [this] {
            CameraTracer& rays = *camera_tracer;
            DeviceGaussians& g = gaussians();
            rays.update(g);
            rays.forward(g, model.camera, true, ViewSizes::kAhead);
            image_loss->evaluate(rays.image(), {photo}, false, {0, 0, 0}, model.camera.width,
                                 model.camera.height, image_gradient);
            rays.backward(g, image_gradient, gradients);
            density->accumulate(g, gradients);
            adam->step(g, gradients, AdamRates{});
          },
          {{"iteration", {}, true, [this] { return iteration_work(); }}}};
}

BenchOperation SceneBench::Impl::iteration_by_bvh() {
  return {[this] {
            make_loss();
            make_gradients();
            make_density();
            density->restore_statistics({});
          },
          {},
          [this] {
            ViewTracer& rays = view_tracer();
            DeviceGaussians& g = gaussians();
            rays.forward(g, model.camera, true);
            image_loss->evaluate(rays.image(), {photo}, false, {0, 0, 0}, model.camera.width,
                                 model.camera.height, image_gradient);
            rays.backward(g, image_gradient, gradients);
            density->accumulate(g, gradients);
            adam->step(g, gradients, AdamRates{});
          },
          {{"iteration-bvh", {}, true, [this] {
              // What the walk itself needs at least depends on the scene: rays alone count.
              BenchWork work{
                  {{"iterations", 1.0}, {"rays", pixels()}}, 2 * RS_WORK_RAY_BYTES * pixels(), 0};
              for (const BenchWork& part :
                   {loss_value_work(), loss_gradient_work(), statistics_work(), adam_work()}) {
                work = together(work, part);
              }
              return work;
            }}}};
}

SceneBench::SceneBench(Context& context, const BenchModel& model, const BenchOptions& options)
    : impl_(std::make_unique<Impl>(context, model, options)) {}
SceneBench::~SceneBench() = default;

std::vector<BenchOperation> SceneBench::operations() {
  Impl& self = *impl_;
  const std::size_t large = self.options.triangles, small = large / 10;
  using Kind = Material::Kind;
  return {self.sort(),
          self.bounds(),
          self.build(),
          self.refit(),
          self.view(),
          self.view_by_bvh(),
          self.backward(),
          self.loss(),
          self.adam_step(),
          self.mean_sample(),
          self.density_statistics(),
          self.densify(),
          self.iteration(),
          self.iteration_by_bvh(),
          self.rays(),
          self.surfaces("surfaces-small", small, true),
          self.surfaces("surfaces-large", large, true),
          self.surfaces("surfaces-random", large, false),
          self.light("light", 0, Kind::kDiffuse, false),
          self.light("light-samples", 0, Kind::kDiffuse, false, 4),
          self.light("light-mesh-small", small, Kind::kDiffuse, false),
          self.light("light-mesh-large", large, Kind::kDiffuse, false),
          self.light("light-mirror", small, Kind::kMirror, false),
          self.light("light-glass", small, Kind::kGlass, false),
          self.light("light-shadows", small, Kind::kDiffuse, true),
          self.packets(PacketShape::kVector),
          self.packets(PacketShape::kGroup),
          self.packets(PacketShape::kSubgroup)};
}

}  // namespace raysplats
