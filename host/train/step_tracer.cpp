// SPDX-License-Identifier: Apache-2.0
#include "train/step_tracer.hpp"

#include <utility>

#include "io/mesh_file.hpp"

namespace raysplats {

Mirrors load_mirrors(const std::vector<std::string>& paths, int max_bounces) {
  Mirrors out;
  out.max_bounces = max_bounces;
  for (const std::string& path : paths) {
    io::MeshFile file = io::read_mesh(path);
    const auto first = static_cast<std::uint32_t>(out.materials.size());
    for (std::uint32_t& material : file.mesh.materials) material += first;
    for (Material& material : file.materials) {
      if (material.kind != Material::Kind::kMirror) material.color = {1.0f, 1.0f, 1.0f};
      material.kind = Material::Kind::kMirror;
      out.materials.push_back(material);
    }
    out.meshes.push_back(std::move(file.mesh));
  }
  return out;
}

StepTracer::StepTracer(Context& context, const TraceOptions& options, Mirrors mirrors)
    : context_(context),
      options_(options),
      mirrors_(std::move(mirrors)),
      packets_(context, options) {}

bool StepTracer::by_rays(const Camera& camera) const {
  return camera.model != CameraModel::kPinhole || !mirrors_.meshes.empty();
}

void StepTracer::update() { packets_updated_ = rays_updated_ = false; }

void StepTracer::forward(const DeviceGaussians& gaussians, const Camera& camera, bool keep) {
  last_by_rays_ = by_rays(camera);
  if (last_by_rays_) {
    if (!rays_) rays_.emplace(context_, options_, mirrors_);
    if (!rays_updated_) rays_->update(gaussians);
    rays_updated_ = true;
    rays_->set_background(options_.background);
    rays_->forward(gaussians, camera, keep);
    return;
  }
  if (!packets_updated_) packets_.update(gaussians);
  packets_updated_ = true;
  packets_.options().background = options_.background;
  packets_.forward(gaussians, camera, keep);
}

const Buffer<float>& StepTracer::image() const {
  return last_by_rays_ ? rays_->image() : packets_.image();
}

Image StepTracer::download_image() const {
  return last_by_rays_ ? rays_->download_image() : packets_.download_image();
}

void StepTracer::backward(const DeviceGaussians& gaussians,
                          const Buffer<float>& image_gradient,
                          GaussianGradients& gradients) {
  if (last_by_rays_) {
    rays_->backward(gaussians, image_gradient, gradients);
  } else {
    packets_.backward(gaussians, image_gradient, gradients);
  }
}

void StepTracer::set_background(const std::array<float, 3>& background) {
  options_.background = background;
}

std::uint64_t StepTracer::capped_rays() const {
  return last_by_rays_ ? rays_->capped_rays() : packets_.statistics().capped_rays;
}

}  // namespace raysplats
