// SPDX-License-Identifier: Apache-2.0
#include "light/mirror_paths.hpp"

#include <fmt/format.h>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

MirrorPaths::MirrorPaths(Context& context, RayTracer& tracer, const Mirrors& mirrors)
    : context_(&context),
      tracer_(&tracer),
      max_bounces_(mirrors.max_bounces),
      scan_(context),
      no_cones_(context, 1, "no cones"),
      no_hits_(context, 1, "no hits"),
      no_words_(context, 1, "no words"),
      no_materials_(context, 1, "no materials"),
      no_colors_(context, 1, "no colours") {
  if (max_bounces_ < 0) {
    throw UsageError(
        fmt::format("A ray cannot meet {} mirrors: give 0 or more bounces", max_bounces_));
  }
  if (!mirrors.meshes.empty()) {
    Scene scene;
    scene.meshes = mirrors.meshes;
    scene.materials = mirrors.materials;
    scene.trace.launch_budget_ms = tracer.options().launch_budget_ms;
    // Only their colour counts here.
    for (Material& material : scene.materials) material.texture = -1;
    surfaces_ = std::make_unique<SurfaceStore>(context, scene);
  }
  levels_.resize(static_cast<std::size_t>(has_mirrors() ? max_bounces_ : 0) + 1);
}

Kernel MirrorPaths::kernel(const char* name) const {
  return context_->kernel("light/mirror_paths.cl", name);
}

// Ends the rays of a level at the mirrors they meet and makes those of the next level. Returns
// their number.
std::size_t MirrorPaths::find_mirrors(std::size_t number) {
  Level& level = levels_[number];
  const Range each = Range::linear(level.count, kGroup);
  level.hits.ensure(*context_, level.count, "mirror hits");
  level.starts.ensure(*context_, level.count + 1, "mirror starts");
  TriangleTracer& triangles = surfaces_->triangles();
  if (number == 0) {
    triangles.nearest(level.rays, level.count, level.hits);
  } else {
    triangles.nearest(level.rays, level.paths, level.count, level.hits);
  }
  const bool last = number + 1 == levels_.size();
  kernel("end_at_mirrors")
      .launch(each, u32(level.count), last ? 1 : 0, level.hits, level.rays, level.starts);
  scan_.exclusive(level.starts, level.count);
  if (last) return 0;
  const std::size_t next = level.starts.read(level.count);
  if (next == 0) return 0;
  Level& after = levels_[number + 1];
  after.rays.ensure(*context_, next, "reflected rays");
  after.paths.ensure(*context_, next, "reflected paths");
  const bool cones = has_cones(tracer_->options());
  if (cones) after.cones.ensure(*context_, next, "reflected cones");
  kernel("reflect_rays")
      .launch(each, u32(level.count), cones ? 1 : 0, level.hits, level.starts,
              surfaces_->vertices(), level.rays, cones ? level.cones : no_cones_, after.rays,
              after.paths, cones ? after.cones : no_cones_);
  return next;
}

void MirrorPaths::trace(const DeviceGaussians& gaussians,
                        std::size_t count,
                        ColorDirection direction,
                        const std::array<float, 3>& background,
                        const Buffer<std::uint32_t>& capped) {
  direction_ = direction;
  background_ = {background[0], background[1], background[2], 0.0f};
  used_ = 0;
  for (std::size_t live = count; live > 0;) {
    Level& level = levels_[used_];
    level.count = live;
    live = has_mirrors() ? find_mirrors(used_) : 0;
    level.results.ensure(*context_, level.count, "ray results");
    tracer_->trace(gaussians, level.rays, level.count, level.results,
                   used_ == 0 ? direction_ : ColorDirection::kRay,
                   has_cones(tracer_->options()) ? &level.cones : nullptr);
    ++used_;
  }
  for (std::size_t number = used_; number-- > 0;) {
    Level& level = levels_[number];
    level.seen.ensure(*context_, level.count, "light of rays");
    kernel("gather_light")
        .launch(Range::linear(level.count, kGroup), u32(level.count), has_mirrors() ? 1 : 0,
                background_, has_mirrors() ? level.hits : no_hits_,
                has_mirrors() ? level.starts : no_words_,
                has_mirrors() ? surfaces_->triangle_materials() : no_words_,
                has_mirrors() ? surfaces_->materials() : no_materials_,
                number + 1 < used_ ? levels_[number + 1].seen : no_colors_, level.results,
                level.seen, capped);
  }
}

std::uint64_t MirrorPaths::reflected_rays() const {
  std::uint64_t sum = 0;
  for (std::size_t number = 1; number < used_; ++number) sum += levels_[number].count;
  return sum;
}

void MirrorPaths::backward(const DeviceGaussians& gaussians,
                           RayBackward& sums,
                           Buffer<RayBackward::PaddedRayGradient>* ray_gradients) {
  if (ray_gradients != nullptr && has_mirrors()) {
    throw UsageError(
        "Gradients of rays and poses do not go through mirrors: leave the mirrors out, or the "
        "gradient of the pose");
  }
  for (std::size_t number = 0; number < used_; ++number) {
    Level& level = levels_[number];
    const bool goes_on = number + 1 < used_;
    if (goes_on) {
      Level& next = levels_[number + 1];
      next.gradients.ensure(*context_, next.count, "ray gradients");
    }
    kernel("spread_gradients")
        .launch(Range::linear(level.count, kGroup), u32(level.count), has_mirrors() ? 1 : 0,
                background_, has_mirrors() ? level.hits : no_hits_,
                has_mirrors() ? level.starts : no_words_,
                has_mirrors() ? surfaces_->triangle_materials() : no_words_,
                has_mirrors() ? surfaces_->materials() : no_materials_,
                goes_on ? levels_[number + 1].seen : no_colors_, level.results, level.gradients,
                goes_on ? levels_[number + 1].gradients : no_colors_);
    sums.add(gaussians, level.rays, level.count, level.results, level.gradients,
             number == 0 ? direction_ : ColorDirection::kRay, ray_gradients);
  }
}

}  // namespace raysplats
