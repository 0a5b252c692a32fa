// SPDX-License-Identifier: Apache-2.0
#include <bit>

#include "bench/scene_state.hpp"
#include "bvh/work.h"
#include "parallel/work.h"
#include "trace/packet_layout.hpp"
#include "trace/work.h"
#include "train/work.h"

namespace raysplats {

BenchWork together(const BenchWork& a, const BenchWork& b) {
  return {a.items, a.bytes + b.bytes, a.flops + b.flops};
}

double SceneBench::Impl::pixels() const {
  return static_cast<double>(model.camera.width) * static_cast<double>(model.camera.height);
}

double SceneBench::Impl::sh_count() const { return sh_coefficients(model.gaussians.sh_degree); }

BenchWork SceneBench::Impl::bounds_work() const {
  const double n = gaussians_count();
  return {{{"boxes", n}}, RS_WORK_BOUNDS_BYTES * n, RS_WORK_BOUNDS_FLOPS * n};
}

BenchWork SceneBench::Impl::order_work() const {
  const double n = gaussians_count();
  const double bytes = RS_WORK_ORDER_BYTES + RS_WORK_ORDER_SORT_PASSES * RS_WORK_SORT_PASS_BYTES;
  return {{{"boxes", n}}, bytes * n, RS_WORK_ORDER_FLOPS * n};
}

BenchWork SceneBench::Impl::nodes_work() const {
  const double n = gaussians_count();
  return {{{"boxes", n}}, RS_WORK_NODES_BYTES * n, RS_WORK_NODES_FLOPS * n};
}

BenchWork SceneBench::Impl::prepare_work() const {
  const double n = gaussians_count();
  return {{{"Gaussians", n}},
          (RS_WORK_PREPARE_BYTES + RS_WORK_SH_BYTES * sh_count()) * n,
          (RS_WORK_PREPARE_FLOPS + RS_WORK_SH_FLOPS * sh_count()) * n};
}

BenchWork SceneBench::Impl::lists_work() const {
  const auto candidates = static_cast<double>(view_statistics.candidates);
  const int tile = packet_layout(context.device(), options.trace).tile;
  const auto across = [tile](int size) { return static_cast<unsigned>((size + tile - 1) / tile); };
  const unsigned tiles = across(model.camera.width) * across(model.camera.height);
  // Keys are a tile and 16 bits of depth.
  const int passes = (16 + static_cast<int>(std::bit_width(tiles - 1)) + 7) / 8;
  return {{{"candidates", candidates}},
          RS_WORK_LIST_GAUSSIAN_BYTES * gaussians_count() +
              (RS_WORK_LIST_BYTES + RS_WORK_SORT_PASS_BYTES * passes) * candidates,
          RS_WORK_LIST_GAUSSIAN_FLOPS * gaussians_count() + RS_WORK_LIST_FLOPS * candidates};
}

BenchWork SceneBench::Impl::forward_work(const CameraTracer::Statistics& seen) const {
  const auto hits = static_cast<double>(seen.hits);
  const auto candidates = static_cast<double>(seen.candidates);
  const bool entry = options.trace.hit_order == HitOrder::kEntry;
  return {{{"rays", pixels()}, {"hits", hits}},
          RS_WORK_FORWARD_CANDIDATE_BYTES * candidates + RS_WORK_FORWARD_PIXEL_BYTES * pixels(),
          (RS_WORK_FORWARD_FLOPS + (entry ? RS_WORK_ENTRY_FLOPS : 0)) * hits};
}

BenchWork SceneBench::Impl::backward_work(const CameraTracer::Statistics& kept) const {
  const auto hits = static_cast<double>(kept.hits);
  return {{{"rays", pixels()}, {"hits", hits}},
          RS_WORK_BACKWARD_GAUSSIAN_BYTES * gaussians_count() +
              RS_WORK_BACKWARD_PIXEL_BYTES * pixels() + static_cast<double>(kept.stream_bytes),
          RS_WORK_BACKWARD_FLOPS * hits};
}

BenchWork SceneBench::Impl::finalize_work() const {
  const double n = gaussians_count();
  return {{{"Gaussians", n}},
          (RS_WORK_FINALIZE_BYTES + 2 * RS_WORK_SH_BYTES * sh_count()) * n,
          (RS_WORK_FINALIZE_FLOPS + RS_WORK_FINALIZE_SH_FLOPS * sh_count()) * n};
}

BenchWork SceneBench::Impl::rays_work() const {
  double hits = 0;
  for (const RayResult& result : ray_results) hits += result.hits;
  const auto rays = static_cast<double>(ray_list.size());
  return {{{"rays", rays}, {"hits", hits}},
          RS_WORK_RAY_BYTES * rays + (RS_WORK_RAY_HIT_BYTES + RS_WORK_SH_BYTES * sh_count()) * hits,
          (RS_WORK_RAY_HIT_FLOPS + RS_WORK_SH_FLOPS * sh_count()) * hits};
}

BenchWork SceneBench::Impl::loss_value_work() const {
  const bool grouped = image_loss->grouped();
  return {{{"pixels", pixels()}},
          (grouped ? RS_WORK_GROUP_LOSS_VALUE_BYTES : RS_WORK_LOSS_VALUE_BYTES) * pixels(),
          (grouped ? RS_WORK_GROUP_LOSS_VALUE_FLOPS : RS_WORK_LOSS_VALUE_FLOPS) * pixels()};
}

BenchWork SceneBench::Impl::loss_gradient_work() const {
  const bool grouped = image_loss->grouped();
  return {{{"pixels", pixels()}},
          (grouped ? RS_WORK_GROUP_LOSS_GRADIENT_BYTES : RS_WORK_LOSS_GRADIENT_BYTES) * pixels(),
          (grouped ? RS_WORK_GROUP_LOSS_GRADIENT_FLOPS : RS_WORK_LOSS_GRADIENT_FLOPS) * pixels()};
}

BenchWork SceneBench::Impl::adam_work() const {
  const double parameters = (RS_WORK_PARAMETERS + 3 * sh_count()) * gaussians_count();
  return {{{"Gaussians", gaussians_count()}, {"parameters", parameters}},
          RS_WORK_ADAM_BYTES * parameters,
          RS_WORK_ADAM_FLOPS * parameters};
}

BenchWork SceneBench::Impl::mean_work() const {
  const double parameters = (RS_WORK_PARAMETERS + 3 * sh_count()) * gaussians_count();
  return {{{"Gaussians", gaussians_count()}, {"parameters", parameters}},
          RS_WORK_MEAN_BYTES * parameters,
          RS_WORK_MEAN_FLOPS * parameters};
}

BenchWork SceneBench::Impl::statistics_work() const {
  const double n = gaussians_count();
  return {{{"Gaussians", n}}, RS_WORK_STATISTICS_BYTES * n, 2 * n};
}

BenchWork SceneBench::Impl::densify_work() const {
  const auto n = static_cast<double>(densified_count);
  const double parameters = RS_WORK_PARAMETERS + 3 * sh_count();
  return {
      {{"Gaussians", n}}, (RS_WORK_DENSIFY_BYTES + RS_WORK_PARAMETER_BYTES * parameters) * n, 0};
}

// One pass over everything.
BenchWork SceneBench::Impl::iteration_work() const {
  BenchWork work{{{"iterations", 1.0}, {"rays", pixels()}}, 0, 0};
  for (const BenchWork& part :
       {bounds_work(), prepare_work(), lists_work(), forward_work(view_statistics),
        loss_value_work(), loss_gradient_work(), backward_work(kept_statistics), finalize_work(),
        statistics_work(), adam_work()}) {
    work = together(work, part);
  }
  return work;
}

}  // namespace raysplats
