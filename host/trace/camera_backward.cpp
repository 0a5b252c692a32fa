// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/matrix.hpp>

#include "raysplats/error.hpp"
#include "trace/camera_tracer_impl.hpp"
#include "trace/gaussian_kernel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kListGroup = 64;

}  // namespace

void CameraTracer::backward(const DeviceGaussians& gaussians,
                            const Buffer<float>& image_gradient,
                            GaussianGradients& gradients,
                            PoseGradient* pose,
                            const Buffer<float>* depth_gradient) {
  Impl& self = *impl_;
  if (!self.hits_kept || self.count != gaussians.count || self.revision != gaussians.revision) {
    throw UsageError(
        "CameraTracer::backward() must follow forward(keep_hits = true) of the same Gaussians");
  }
  self.depth_gradient = depth_gradient;
  bool further = false;
  for (const int number : self.faces()) {
    if (self.faces().size() > 1) self.set_face(gaussians, number);
    self.backward_face(gaussians, image_gradient);
    self.sums.round();
    self.finalize(gaussians, gradients, further, false);
    self.sums.settle();
    if (pose != nullptr) {
      if (!further) *pose = {};
      self.add_pose(gaussians, *pose);
    }
    further = true;
  }
}

// Gradients of the lines of one face.
void CameraTracer::Impl::backward_face(const DeviceGaussians& gaussians,
                                       const Buffer<float>& image_gradient) {
  sums.prepare(sum_choice(gaussians.count), gaussians.count);
  if (hits_complete) {
    launch_backward(image_gradient, 0, lists.tile_rows());
    return;
  }
  // Bands whose hits should fit, so that few are traced only to find that they do not.
  const std::size_t wanted = saved.stream_bytes / streams.chunk_bytes();
  const std::size_t all = lists.tile_rows();
  const auto band = static_cast<std::uint32_t>(
      std::max<std::size_t>(1, all * streams.capacity() * 3 / 4 / wanted));
  for (std::uint32_t row = 0; row < all; row += band) {
    backward_tile_rows(gaussians, image_gradient, row,
                       std::min(band, static_cast<std::uint32_t>(all) - row));
  }
}

// Traces rows again with the pool to themselves, then runs them backwards; halves them until their
// hits fit.
void CameraTracer::Impl::backward_tile_rows(const DeviceGaussians& gaussians,
                                            const Buffer<float>& image_gradient,
                                            std::uint32_t row,
                                            std::uint32_t rows) {
  counters.clear();
  trace_tile_rows(gaussians, row, rows);
  const std::size_t wanted = counters.read(RS_COUNT_CHUNKS);
  if (wanted > streams.capacity() && rows > 1) {
    backward_tile_rows(gaussians, image_gradient, row, rows / 2);
    backward_tile_rows(gaussians, image_gradient, row + rows / 2, rows - rows / 2);
    return;
  }
  // A row of tiles is the least, whatever its share of the budget.
  if (wanted > streams.capacity()) {
    if (wanted > streams.largest()) {
      throw ResourceError(fmt::format(
          "The hits of one row of tiles need {:.1f} MiB, the device has buffers of {:.1f} MiB: "
          "raise --downscale",
          static_cast<double>(wanted * streams.chunk_bytes()) / (1 << 20),
          static_cast<double>(streams.largest() * streams.chunk_bytes()) / (1 << 20)));
    }
    streams.grow(wanted, wanted);
    counters.clear();
    trace_tile_rows(gaussians, row, rows);
  }
  launch_backward(image_gradient, row, rows);
}

std::vector<Kernel> CameraTracer::Impl::backward_pass(int lens,
                                                      const GradientSumChoice& choice,
                                                      bool with_depth) {
  BuildOptions build = kernels.build(lens);
  build.define("DEPTH_GRADIENT", with_depth ? 1 : 0).define("LEAST_WEIGHT", options.least_weight);
  return kernels.backward(choice.define(build, context.device()));
}

std::array<Kernel, 2> CameraTracer::Impl::segment_pass(int lens, bool with_depth) {
  BuildOptions build = kernels.build(lens);
  build.define("DEPTH_GRADIENT", with_depth ? 1 : 0);
  return kernels.segments(build);
}

// Cuts the streams of the rows of tiles that `pass` names into segments.
void CameraTracer::Impl::cut_streams(const Buffer<float>& image_gradient, const RsBackward& pass) {
  auto [list, sum] = segment_pass(lens_kind, depth_gradient != nullptr);
  segments.prepare(packet_count(), streams.capacity());
  const Range all = kernels.range(list, 1, camera.width, {lists.tiles_x(), 0, pass.tile_rows});
  list.launch(Range::linear(all.global[0] / kernels.items() * all.global[1], kListGroup),
              view_arguments(), pass, streams.ends(), streams.pool(), segments.segments(),
              segments.counts());
  launch_in_bands(context, segment_budgets[0], sum, segments.room() * kernels.items(),
                  kernels.items(), view_arguments(), pass, streams.arguments(), lists.lines(),
                  image_gradient, depth_slopes(), segments.arguments());
}

void CameraTracer::Impl::launch_backward(const Buffer<float>& image_gradient,
                                         std::uint32_t row,
                                         std::uint32_t rows) {
  std::vector<Kernel> launched = backward_pass(lens_kind, sums.choice(), depth_gradient != nullptr);
  RsBackward pass{};
  pass.gaussians = static_cast<std::uint32_t>(count);
  pass.copies = static_cast<std::uint32_t>(sums.copies());
  pass.tiles_x = lists.tiles_x();
  std::copy(options.background.begin(), options.background.end(), pass.background);
  pass.screen_x = screen_x();
  pass.screen_y = screen_y();
  // No ray meets a Gaussian twice.
  pass.limit = GradientSums::limit(packet_count() * static_cast<std::size_t>(packet().lanes));
  pass.tile_row = row;
  pass.tile_rows = rows;
  if (cuts_streams(sums.choice())) {
    cut_streams(image_gradient, pass);
    for (std::size_t k = 0; k < launched.size(); ++k) {
      launch_in_bands(context, segment_budgets[k + 1], launched[k],
                      segments.room() * kernels.items(), kernels.items(), view_arguments(), pass,
                      streams.arguments(), lists.lines(), image_gradient, depth_slopes(),
                      sums.target(), segments.arguments());
    }
    return;
  }
  const bool shared = !sums.is_private();
  // All bands of a kernel before the next one: private sums keep that order whatever the bands.
  for (std::size_t k = 0; k < launched.size(); ++k) {
    Kernel& kernel = launched[k];
    in_bands(context, backward_budgets[k], rows, [&](std::uint32_t first, std::uint32_t number) {
      // Shared sums find their rows by the offset of the launch.
      pass.tile_row = shared ? row : row + first;
      pass.tile_rows = number;
      const Range range =
          shared ? kernels.range(kernel, 1, camera.width, {lists.tiles_x(), first, number})
                 : Range{{sums.copies() * kernels.items(), 1, 1}, {kernels.items(), 1, 1}, {}};
      kernel.launch(range, view_arguments(), pass, streams.arguments(), lists.lines(),
                    image_gradient, depth_slopes(), sums.target());
    });
  }
}

GaussianKernel CameraTracer::Impl::finalize_kernel(
    const DeviceGaussians& gaussians, int lens, bool with_depth, bool accumulate, bool with_pose) {
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0)
      .define("POSE", with_pose ? 1 : 0)
      .define("ACCUMULATE", accumulate ? 1 : 0)
      .define("DEPTH_GRADIENT", with_depth ? 1 : 0)
      .define("RAISE_CLAMPED", options.raise_clamped ? 1 : 0)
      .define("LENS", lens)
      .define("VIEW_FOOTPRINT", options.view_footprint > 0 ? 1 : 0)
      .define("SH_DEGREE", gaussians.active_sh_degree)
      .define("SH_COEFFICIENTS", sh_coefficients(gaussians.sh_degree));
  const bool cpu = context.device().type == DeviceType::kCpu;
  return {context, cpu ? "trace/finalize_gradients.cl" : "trace/group_finalize.cl",
          cpu ? "finalize_gradients" : "finalize_group", build};
}

void CameraTracer::Impl::finalize(const DeviceGaussians& gaussians,
                                  GaussianGradients& gradients,
                                  bool accumulate,
                                  bool with_pose) {
  const std::size_t n = gaussians.count;
  gradients.ensure(context, gaussians);
  pose.ensure(context, with_pose ? 6 * n : 1, "pose gradients");
  GaussianKernel kernel =
      finalize_kernel(gaussians, lens_kind, depth_gradient != nullptr, accumulate, with_pose);
  const RsFinalize pass{static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(sums.copies()),
                        screen_x(), screen_y()};
  kernel.launch(n, pass, camera, sums.lines(), lists.bounds(), lists.lines(), gaussians.arguments(),
                gradients.arguments(), pose);
}

// What the lines of one face, whose sums are still there, say of the pose.
void CameraTracer::Impl::add_pose(const DeviceGaussians& gaussians, PoseGradient& sum) {
  finalize(gaussians, pose_scratch, false, true);
  const std::vector<float> parts = pose.download();
  std::array<double, 6> total{};
  for (std::size_t i = 0; i + 6 <= parts.size(); i += 6) {
    for (std::size_t j = 0; j < 6; ++j) total[j] += static_cast<double>(parts[i + j]);
  }
  // A turn in camera axes is the same turn in the axes of the face.
  const glm::dvec3 turn =
      glm::transpose(LensTiles::rotation(face)) * glm::dvec3(total[3], total[4], total[5]);
  for (std::size_t j = 0; j < 3; ++j) {
    sum.center[j] += total[j];
    sum.rotation[j] += turn[static_cast<int>(j)];
  }
}

}  // namespace raysplats
