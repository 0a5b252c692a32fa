// SPDX-License-Identifier: Apache-2.0
#include "light/first_hit_tracer.hpp"

#include <cstdint>
#include <span>

namespace raysplats {
namespace {

constexpr const char* kProgram = "light/first_hits.cl";
constexpr std::size_t kGroup = 64;

}  // namespace

std::vector<RayResult> FirstHitTracer::trace(const DeviceGaussians& gaussians,
                                             SurfaceStore& surfaces,
                                             const Camera& camera,
                                             std::size_t first,
                                             std::size_t count) {
  const Range each = Range::linear(count, kGroup);
  const auto rays = static_cast<std::uint32_t>(count);
  camera_rays_.generate(camera, Lens{}, first, count, rays_);
  hits_.ensure(context_, count, "surface hits");
  surfaces.triangles().nearest(rays_, count, hits_);
  context_.kernel(kProgram, "end_at_surfaces").launch(each, rays, hits_, rays_);
  const DeviceGaussians& normals = normals_.of(gaussians, camera);
  tracer_.follow(normals);
  const bool cones = has_cones(tracer_.options());
  if (cones) {
    camera_rays_.cones(camera, tracer_.options().view_footprint, rays_, count, cones_);
  }
  tracer_.trace(normals, rays_, count, results_, ColorDirection::kRay, cones ? &cones_ : nullptr);
  context_.kernel(kProgram, "add_surfaces")
      .launch(each, rays, depth_axis(camera), hits_, surfaces.vertices(), rays_, results_);
  std::vector<RayResult> out(count);
  results_.download(std::span<RayResult>(out));
  return out;
}

}  // namespace raysplats
