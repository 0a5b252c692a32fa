// SPDX-License-Identifier: Apache-2.0
#include "light/triangle_tracer.hpp"

#include <fmt/format.h>

#include <cmath>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "shared/tree_layout.h"
#include "trace/ray_launch.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
// As in RayTracer: on CPUs a work-item traces several rays one after the other.
constexpr std::size_t kCpuRaysPerItem = 64;

// Positions of the corners of all triangles, nine floats each.
std::vector<float> corners_of(std::span<const Mesh> meshes) {
  std::vector<float> corners;
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const Mesh& mesh = meshes[m];
    for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
      if (!std::isfinite(mesh.positions[i])) {
        throw DataError(
            fmt::format("Vertex {} of mesh {} is not finite: repair the mesh", i / 3, m));
      }
    }
    for (std::size_t i = 0; i < 3 * mesh.triangle_count(); ++i) {
      const std::size_t vertex = mesh.triangles[i];
      if (vertex >= mesh.vertex_count()) {
        throw DataError(fmt::format("Triangle {} of mesh {} names vertex {} of {}: repair the mesh",
                                    i / 3, m, vertex, mesh.vertex_count()));
      }
      const auto from = mesh.positions.begin() + static_cast<std::ptrdiff_t>(3 * vertex);
      corners.insert(corners.end(), from, from + 3);
    }
  }
  return corners;
}

}  // namespace

TriangleTracer::TriangleTracer(Context& context, double launch_budget_ms)
    : TriangleTracer(context, tree_form(context.device()), launch_budget_ms) {}

TriangleTracer::TriangleTracer(Context& context, const TreeForm& form, double launch_budget_ms)
    : context_(&context),
      tree_(context, form),
      budget_(launch_budget_ms, context.device().type),
      no_skip_(context, 1, "no triangle to skip") {}

void TriangleTracer::build(std::span<const Mesh> meshes) {
  const std::vector<float> corners = corners_of(meshes);
  const std::size_t count = corners.size() / 9;
  corners_.ensure(*context_, corners.size(), "triangles");
  corners_.upload(corners);
  boxes_.ensure(*context_, count, "triangle boxes");
  const BuildOptions build = tree_build(tree_.form());
  if (count > 0) {
    context_->kernel("light/triangle_blocks.cl", "triangle_bounds", build)
        .launch(Range::linear(count, kGroup), corners_, u32(count), boxes_);
  }
  tree_.order(boxes_, count);
  blocks_.ensure(
      *context_,
      tree_.block_count() * RS_TRIANGLE_VECTORS * static_cast<std::size_t>(tree_.lanes()),
      "triangle blocks");
  if (count == 0) return;
  const std::size_t padded = tree_.padded_blocks();
  context_->kernel("light/triangle_blocks.cl", "fill_triangles", build)
      .launch(Range::linear(padded, kGroup), u32(count), u32(padded), tree_.slots(), boxes_,
              corners_, blocks_, tree_.nodes());
  tree_.merge();
}

template <class... Arguments>
void TriangleTracer::launch_rays(const char* kernel,
                                 std::size_t count,
                                 const Arguments&... arguments) {
  const bool shares = shares_items(context_->device(), tree_.form());
  const std::size_t each = shares ? kCpuRaysPerItem : 1;
  launch_in_bands(
      *context_, budget_,
      context_->kernel("light/triangle_tracer.cl", kernel, tree_walk_build(tree_.form())),
      (count + each - 1) / each, shares ? 1 : kGroup, u32(count), u32(each),
      tree_.arguments(blocks_), arguments...);
}

template <class Skip>
void TriangleTracer::launch_nearest(const Buffer<Ray>& rays,
                                    const Skip& skip,
                                    std::uint32_t skip_stride,
                                    std::size_t count,
                                    Buffer<RsSurfaceHit>& hits) {
  if (hits.size() < count) hits.ensure(*context_, count, "surface hits");
  launch_rays("nearest_surface", count, rays, skip, skip_stride, hits);
}

void TriangleTracer::nearest(const Buffer<Ray>& rays,
                             std::size_t count,
                             Buffer<RsSurfaceHit>& hits) {
  launch_nearest(rays, no_skip_, 0, count, hits);
}

void TriangleTracer::nearest(const Buffer<Ray>& rays,
                             const Buffer<RsPath>& paths,
                             std::size_t count,
                             Buffer<RsSurfaceHit>& hits) {
  launch_nearest(rays, BufferAs<std::int32_t>{paths.raw()},
                 u32(sizeof(RsPath) / sizeof(std::int32_t)), count, hits);
}

void TriangleTracer::light_through(const Buffer<Ray>& rays,
                                   const Buffer<std::int32_t>& skip,
                                   const Buffer<float>& shadow,
                                   std::size_t count,
                                   Buffer<float>& passes) {
  if (passes.size() < count) passes.ensure(*context_, count, "light that passes");
  launch_rays("light_through", count, rays, skip, 1u, shadow, passes);
}

}  // namespace raysplats
