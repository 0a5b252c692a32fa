// SPDX-License-Identifier: Apache-2.0
#include "light/path_memory.hpp"

#include <fmt/format.h>

#include <cstdint>

#include "bvh/lbvh.hpp"
#include "light/environment.hpp"
#include "raysplats/error.hpp"
#include "raysplats/rays.hpp"
#include "shared/light_layout.h"
#include "shared/tree_layout.h"
#include "trace/memory_shares.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tree.hpp"
#include "util/mebibytes.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kFloat = sizeof(float);
// Two glass surfaces that both reflect and refract.
constexpr std::size_t kPathsThroughGlass = 4;
constexpr std::size_t kLeastBatch = 64;
constexpr std::size_t kMaxBatch = std::size_t{1} << 20;
// CPUs are busy with fewer, and a picture in more parts tells how far it is.
constexpr std::size_t kMaxCpuBatch = std::size_t{1} << 17;

// A path with its ray and two that may follow from it, what it meets and gathers, the order in
// which rays are traced.
constexpr std::size_t kPathBytes = 3 * (sizeof(Ray) + sizeof(RsPath)) + sizeof(RsCone) +
                                   sizeof(RsSurfaceHit) + sizeof(RsSurface) + sizeof(RayResult) +
                                   16 * kFloat + 6 * sizeof(std::uint32_t) + RayOrder::kBytesPerRay;
// A shadow ray, what it leaves out, what surfaces and Gaussians take of it.
constexpr std::size_t kShadowBytes =
    sizeof(Ray) + sizeof(std::int32_t) + kFloat + sizeof(RayResult);
constexpr std::size_t kPixelBytes = 4 * kFloat;
// Picture of packets with depths, transmittances and the place of a pixel behind a lens, sums.
constexpr std::size_t kPacketPixelBytes = 16 * kFloat + kPixelBytes;

constexpr std::size_t kVertexBytes = RS_TRIANGLE_FLOATS * kFloat;  // of the corners of a triangle

bool has_glass(const Scene& scene) {
  return std::any_of(scene.materials.begin(), scene.materials.end(),
                     [](const Material& m) { return m.kind == Material::Kind::kGlass; });
}

}  // namespace

std::size_t mesh_bytes(std::size_t triangles, const TreeForm& form) {
  constexpr std::size_t corners = 9 * kFloat;
  constexpr std::size_t attributes = kVertexBytes + sizeof(std::uint32_t) + kFloat;
  constexpr std::size_t block = RS_TRIANGLE_VECTORS * kFloat;
  return triangles * (corners + attributes + sizeof(RsAabb) + block + Lbvh::bytes_per_box(form));
}

PathMemory::PathMemory(const Scene& scene, const DeviceInfo& device)
    : device_(device), form_(tree_form(device)) {
  const std::size_t paths = has_glass(scene) ? kPathsThroughGlass : 1;
  pixel_ = kPixelBytes + paths * (kPathBytes + (scene.lights.empty() ? 0 : kShadowBytes));
  pixel_largest_ = 2 * paths * sizeof(RsPath);
  const std::size_t room = std::min(MemoryShares(scene.trace, device).paths() / pixel_,
                                    device.max_allocation / pixel_largest_);
  batch_ = std::clamp<std::size_t>(room, kLeastBatch,
                                   device.type == DeviceType::kCpu ? kMaxCpuBatch : kMaxBatch);

  const std::size_t count = scene.gaussians.size();
  const std::size_t sh =
      3 * kFloat * static_cast<std::size_t>(sh_coefficients(scene.gaussians.sh_degree));
  const std::size_t block = kFloat * RayTree::block_floats(scene.trace, form_);
  gaussians_ = count * (11 * kFloat + sh + sizeof(RsAabb) + block + Lbvh::bytes_per_box(form_));
  packets_ = count * (sizeof(RsLine) + sizeof(RsViewBounds) + sizeof(RsAabb) + 4) +
             MemoryShares(scene.trace, device).tile_lists();
  set_render(scene.render);
  std::size_t texels = 0;
  for (const Image& texture : scene.textures) texels += kFloat * texture.data.size();
  const std::size_t environment =
      kFloat * (shows_sky(scene.environment) ? std::size_t{6} * kSkyHeight * kSkyHeight
                                             : scene.environment.equirect.data.size());
  pictures_ = texels + environment;
  largest_ = std::max({count * sh, count * block, texels, environment});
  std::size_t triangles = 0;
  for (const Mesh& mesh : scene.meshes) triangles += mesh.triangle_count();
  set_meshes(triangles);
}

void PathMemory::set_render(const RenderSettings& settings, bool of_many) {
  const bool through_centre = settings.samples == 1 && !of_many;
  one_point_ = through_centre || settings.aperture == 0.0f;
}

bool PathMemory::packets(std::size_t pixels) const {
  return one_point_ && pixels > 0 && pixels * kPixelBytes <= device_.max_allocation &&
         gaussians() + surfaces() + rays(pixels) + packet_bytes(pixels) <= usable_memory(device_);
}

std::size_t PathMemory::rays(std::size_t pixels) const { return std::min(pixels, batch_) * pixel_; }

std::size_t PathMemory::packet_bytes(std::size_t pixels) const {
  return packets_ + pixels * kPacketPixelBytes;
}

std::size_t PathMemory::paths(std::size_t pixels) const {
  return rays(pixels) + (packets(pixels) ? packet_bytes(pixels) : 0);
}

void PathMemory::set_meshes(std::size_t triangles) {
  meshes_ = mesh_bytes(triangles, form_);
  largest_mesh_ = triangles * kVertexBytes;
}

std::size_t PathMemory::largest_buffer(std::size_t pixels) const {
  return std::max({largest_, largest_mesh_, std::min(pixels, batch_) * pixel_largest_,
                   packets(pixels) ? pixels * kPixelBytes : std::size_t{0}});
}

void PathMemory::check(std::size_t pixels) const {
  if (total(pixels) <= usable_memory(device_) && largest_buffer(pixels) <= device_.max_allocation)
    return;
  throw ResourceError(fmt::format(
      "The scene needs about {:.0f} MiB ({:.0f} for Gaussians, {:.0f} for meshes, textures and the "
      "environment, {:.0f} for paths; {:.0f} in the largest buffer) but {} has {:.0f} MiB, of "
      "which it may take nine tenths, and {:.0f} MiB in one buffer: lower memory-budget, or use "
      "fewer Gaussians or triangles, or smaller textures",
      mib(total(pixels)), mib(gaussians()), mib(surfaces()), mib(paths(pixels)),
      mib(largest_buffer(pixels)), device_.name, mib(device_.global_memory),
      mib(device_.max_allocation)));
}

}  // namespace raysplats
