// SPDX-License-Identifier: Apache-2.0
#include "trace/view_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <span>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Rays and results of a batch, on the device and here.
constexpr std::size_t kRayBytes = sizeof(Ray) + sizeof(RayResult);
constexpr std::size_t kLeastBatch = 4096;
// Larger batches are not faster and take their memory twice.
constexpr std::size_t kMostBatch = std::size_t{1} << 20;

}  // namespace

ViewTracer::ViewTracer(Context& context, const TraceOptions& options)
    : context_(context),
      options_(options),
      packets_(context, options),
      generator_(context),
      tracer_(context, options) {}

void ViewTracer::update(const DeviceGaussians& gaussians) {
  packets_.update(gaussians);
  tree_built_ = false;
}

Image ViewTracer::render(const DeviceGaussians& gaussians, const Camera& camera) {
  if (camera.model != CameraModel::kPinhole) return render_rays(gaussians, camera);
  packets_.forward(gaussians, camera);
  by_rays_ = false;
  capped_rays_ = packets_.statistics().capped_rays;
  return packets_.download_image();
}

Image ViewTracer::render_rays(const DeviceGaussians& gaussians, const Camera& camera) {
  require_pixels(camera);
  if (options_.near_depth > 0.0f) {
    throw UsageError(fmt::format(
        "The near plane at {} cuts for pinholes only, and the camera '{}' is none: use --near 0",
        options_.near_depth, camera.name));
  }
  if (!tree_built_) {
    tracer_.update(gaussians);
    tree_built_ = true;
  }
  by_rays_ = true;
  capped_rays_ = 0;
  image_ = Image(camera.width, camera.height, 4);
  depth_ = options_.depth ? Image(camera.width, camera.height, 3) : Image();
  const std::size_t batch =
      std::clamp(options_.memory_budget / 4 / kRayBytes, kLeastBatch, kMostBatch);
  for (std::size_t first = 0; first < image_.pixels(); first += batch) {
    const std::size_t count = std::min(batch, image_.pixels() - first);
    generator_.generate(camera, Lens{}, first, count, rays_);
    tracer_.trace(gaussians, rays_, count, results_, color_direction(camera));
    store(first, count, camera);
  }
  return std::move(image_);
}

void ViewTracer::store(std::size_t first, std::size_t count, const Camera& camera) {
  host_results_.resize(count);
  results_.download(std::span<RayResult>(host_results_));
  // Rays have unit length; packets count depth along z.
  const bool along_axis =
      camera.model == CameraModel::kPinhole || camera.model == CameraModel::kOpenCv;
  const glm::dvec3 axis = glm::transpose(camera.rotation) * glm::dvec3(0, 0, 1);
  if (options_.depth && along_axis) {
    host_rays_.resize(count);
    rays_.download(std::span<Ray>(host_rays_));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const RayResult& result = host_results_[i];
    float* pixel = &image_.data[4 * (first + i)];
    std::copy(result.color, result.color + 3, pixel);
    pixel[3] = result.alpha;
    capped_rays_ += result.capped;
    if (!options_.depth) continue;
    float cosine = 1.0f;
    if (along_axis) {
      const float* d = host_rays_[i].direction;
      cosine = static_cast<float>(glm::dot(axis, glm::dvec3(d[0], d[1], d[2])));
    }
    float* depth = &depth_.data[3 * (first + i)];
    depth[0] = cosine * result.expected_depth;
    depth[1] = cosine * result.median_depth;
    depth[2] = static_cast<float>(result.hits);
  }
}

Image ViewTracer::depth() const { return by_rays_ ? depth_ : packets_.download_depth(); }

}  // namespace raysplats
