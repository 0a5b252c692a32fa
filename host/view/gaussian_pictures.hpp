// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>

#include "light/normal_pictures.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/context.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"
#include "view/picture_source.hpp"

namespace raysplats::view {

/// Pictures of Gaussians that may change between them, as they do during training; context and
/// Gaussians outlive it.
class GaussianPictures : public PictureSource {
 public:
  /// Nothing is made on the device before the first picture.
  GaussianPictures(Context& context,
                   const DeviceGaussians& gaussians,
                   const TraceOptions& options,
                   Mirrors mirrors);

  Image draw(const ViewRequest& request, std::uint64_t sample, const Watch& watch) override;
  std::optional<glm::dvec3> point(const ViewRequest& request) override;
  std::uint64_t samples() const override;
  bool has_depth() const override { return mirrors_.meshes.empty(); }

  /// Shows these Gaussians from the next picture on; they outlive it too.
  void set_gaussians(const DeviceGaussians& gaussians) { gaussians_ = &gaussians; }
  /// What is behind everything where a page wishes nothing else: a colour in [0, 1], or a sky.
  void set_background(const std::array<float, 3>& background, const SkyLight& sky) {
    options_.background = background;
    options_.sky = sky;
  }

 private:
  /// Gives the device's memory back until the next picture.
  void release();
  Image drawn(const ViewRequest& request, std::uint64_t sample, const Watch& watch);
  ViewTracer& tracer(bool depth, const ViewRequest& request);

  Image normals_of(const Camera& camera, const Watch& watch);

  Context& context_;
  const DeviceGaussians* gaussians_;
  TraceOptions options_;
  Mirrors mirrors_;
  float near_;  // of the tracers
  HitOrder order_;
  std::unique_ptr<ViewTracer> color_;
  std::unique_ptr<ViewTracer> depth_;
  std::unique_ptr<NormalPictures> normals_;
};

}  // namespace raysplats::view
