// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "bench/scene_bench.hpp"
#include "bvh/gaussian_bounds.hpp"
#include "light/triangle_tracer.hpp"
#include "light/view_tracer.hpp"
#include "parallel/radix_sort.hpp"
#include "raysplats/path_tracer.hpp"
#include "raysplats/scene.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/ray_tracer.hpp"
#include "train/density/density_control.hpp"
#include "train/loss/image_loss.hpp"
#include "train/optimizer/adam.hpp"
#include "train/optimizer/parameter_mean.hpp"

namespace raysplats {

/// What the operations of one scene share. Members are made when first needed.
struct SceneBench::Impl {
  Impl(Context& context_in, const BenchModel& model_in, const BenchOptions& options_in)
      : context(context_in), model(model_in), options(options_in) {}

  std::size_t count() const { return model.gaussians.size(); }
  double gaussians_count() const { return static_cast<double>(count()); }
  double pixels() const;
  double sh_count() const;

  DeviceGaussians& gaussians();
  const Buffer<RsAabb>& boxes();  ///< of the Gaussians
  CameraTracer& tracer();         ///< with an up-to-date tree
  RayTracer& rays_tracer();
  ViewTracer& view_tracer();  ///< the same of every ray's walk through the tree
  void forward_with_hits();
  void make_loss();
  void make_gradients();
  void make_density();
  void make_rays();
  DeviceGaussians copy_of_gaussians();
  /// Where most of the model is.
  struct Middle {
    std::array<double, 3> center{};
    std::array<double, 3> half{1.0, 1.0, 1.0};
  };
  Middle middle() const;
  /// A closed body of about `triangles` triangles in the middle of the model.
  Mesh body(std::size_t triangles) const;
  void make_light_tracer(std::size_t triangles, Material::Kind kind, bool lights, int samples);
  void make_triangles(std::size_t triangles, bool camera_rays);

  BenchOperation bounds();
  BenchOperation sort();
  BenchOperation build();
  BenchOperation refit();
  BenchOperation view();
  BenchOperation view_by_bvh();
  BenchOperation backward();
  /// Both passes in one shape of packets, which need not be the device's own.
  BenchOperation packets(PacketShape shape);
  BenchOperation iteration_by_bvh();
  BenchOperation rays();
  BenchOperation loss();
  BenchOperation adam_step();
  BenchOperation mean_sample();
  BenchOperation density_statistics();
  BenchOperation densify();
  BenchOperation iteration();
  BenchOperation surfaces(const char* row, std::size_t triangles, bool camera_rays);
  /// One image by PathTracer; no body for 0 triangles.
  BenchOperation light(
      const char* row, std::size_t triangles, Material::Kind kind, bool lights, int samples = 1);

  BenchWork bounds_work() const;
  BenchWork order_work() const;
  BenchWork nodes_work() const;
  BenchWork prepare_work() const;
  BenchWork lists_work() const;
  BenchWork forward_work(const CameraTracer::Statistics& seen) const;
  BenchWork backward_work(const CameraTracer::Statistics& kept) const;
  BenchWork finalize_work() const;
  BenchWork rays_work() const;
  BenchWork loss_value_work() const;
  BenchWork loss_gradient_work() const;
  BenchWork adam_work() const;
  BenchWork mean_work() const;
  BenchWork statistics_work() const;
  BenchWork densify_work() const;
  BenchWork iteration_work() const;

  Context& context;
  const BenchModel& model;
  const BenchOptions& options;

  std::optional<DeviceGaussians> device_gaussians;
  std::optional<GaussianBounds> bounds_kernel;
  Buffer<RsAabb> box_buffer;
  std::optional<RadixSort> sorter;
  Buffer<std::uint32_t> unsorted, keys, values;
  std::unique_ptr<CameraTracer> camera_tracer;
  std::uint64_t traced_revision = 0;  // of the Gaussians at its last update()
  std::unique_ptr<ViewTracer> tree_view_tracer;
  CameraTracer::Statistics view_statistics, kept_statistics;
  std::unique_ptr<CameraTracer> shaped_tracer;  // one at a time: each keeps its own hits
  CameraTracer::Statistics shaped_statistics;
  std::unique_ptr<RayTracer> ray_tracer;
  std::vector<Ray> ray_list;
  std::vector<RayResult> ray_results;
  std::unique_ptr<ImageLoss> image_loss;
  Buffer<float> picture, image_gradient;
  Buffer<std::uint32_t> photo;
  std::optional<Adam> adam;
  std::optional<ParameterMean> mean;
  Buffer<std::uint32_t> open_guard;
  GaussianGradients gradients;
  std::optional<DensityControl> density;
  std::vector<float> density_signal;
  DeviceGaussians densified;
  std::size_t densified_count = 0;
  std::unique_ptr<TriangleTracer> triangle_tracer;
  Buffer<Ray> surface_rays;
  Buffer<RsSurfaceHit> surface_hits;
  std::unique_ptr<PathTracer> light_tracer;
};

/// Bytes and flops of both, items of the first.
BenchWork together(const BenchWork& a, const BenchWork& b);

}  // namespace raysplats
