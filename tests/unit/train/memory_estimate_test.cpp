// SPDX-License-Identifier: Apache-2.0
#include "train/memory_estimate.hpp"

#include <doctest/doctest.h>

#include <cstddef>
#include <span>
#include <string>
#include <utility>

#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "trace/camera_tracer.hpp"
#include "train/density/density_control.hpp"
#include "train/optimizer/adam.hpp"
#include "train/optimizer/footprint.hpp"
#include "unit/trace/trace_fixture.hpp"
#include "util/mebibytes.hpp"

using namespace raysplats;

namespace {

// A line of 16 gradients whose sums have six words of 32 bits each.
constexpr std::size_t kExactLineBytes = 16 * 6 * 4;

DeviceInfo device_with(std::uint64_t memory, std::uint64_t allocation) {
  DeviceInfo device;
  device.name = "a device";
  device.type = DeviceType::kGpu;
  device.global_memory = memory;
  device.max_allocation = allocation;
  return device;
}

std::string refusal(const TrainOptions& options,
                    const MemoryDemand& demand,
                    const DeviceInfo& device) {
  try {
    check_memory(options, demand, device);
  } catch (const ResourceError& error) {
    return error.what();
  }
  return "";
}

// A wall behind the cube of the reference scenes, its triangles again and again.
constexpr std::size_t kWallTriangles = 2 * 4000;
Mirrors wall() {
  Mirrors out;
  Mesh mesh;
  mesh.positions = {-9, -9, 2, 9, -9, 2, 9, 9, 2, -9, 9, 2};
  for (std::size_t i = 0; i < kWallTriangles / 2; ++i) {
    mesh.triangles.insert(mesh.triangles.end(), {0, 1, 2, 0, 2, 3});
  }
  mesh.materials.assign(kWallTriangles, 0);
  out.materials.resize(1);
  out.materials[0].kind = Material::Kind::kMirror;
  out.meshes.push_back(mesh);
  return out;
}

// Most bytes that a view traced ray by ray holds, forward and backward, beside model, gradients and
// picture.
std::size_t bytes_of_rays(const Gaussians& model,
                          int width,
                          const TraceOptions& options,
                          const Mirrors& mirrors) {
  Context context = make_test_context();
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::size_t pixels = pixel_count(width, width);
  Buffer<float> image_gradient(context, 4 * pixels, "image gradient");
  image_gradient.clear();
  const std::size_t before = context.allocated_bytes();
  ViewTracer tracer(context, options, mirrors);
  GaussianGradients gradients;
  tracer.forward_rays(gaussians, reference::cube_camera(width, width), true);
  tracer.backward(gaussians, image_gradient, gradients);
  const std::size_t known =
      4 * (model.size() * (3 + 4 + 3 + 1 + 4) + model.sh.size()) + sizeof(float) * 4 * pixels;
  return context.peak_allocated_bytes() - before - known;
}

// The same of a view traced in packets, beside the records of Gaussians that the estimate counts.
std::size_t bytes_of_packets(const Gaussians& model, int width, const TraceOptions& options) {
  Context context = make_test_context();
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::size_t pixels = pixel_count(width, width);
  Buffer<float> image_gradient(context, 4 * pixels, "image gradient");
  image_gradient.clear();
  const std::size_t before = context.allocated_bytes();
  CameraTracer tracer(context, options);
  GaussianGradients gradients;
  tracer.update(gaussians);
  tracer.forward(gaussians, reference::cube_camera(width, width), true);
  tracer.backward(gaussians, image_gradient, gradients);
  const std::size_t known =
      4 * (model.size() * (3 + 4 + 3 + 1 + 4) + model.sh.size()) + sizeof(float) * 6 * pixels;
  return context.peak_allocated_bytes() - before - known;
}

// Most bytes that the state of a training holds while a refinement replaces Gaussians.
std::size_t bytes_of_state(const Gaussians& model, const TrainOptions& options) {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(8, 8);
  Footprint footprint(context, std::span(&camera, 1), options.footprint);
  Adam adam(context, {});
  DensityControl density(context, options, 1.0, 1);
  density.set_limit(model.size());
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::size_t before = context.allocated_bytes() - 4 * (11 * model.size() + model.sh.size());
  adam.initialize(gaussians.count, gaussians.sh_degree);
  GaussianGradients gradients;
  gradients.ensure(context, gaussians);
  gradients.screen.clear();
  density.accumulate(gaussians, gradients);
  footprint.update(gaussians);
  const DensityPlan plan = density.refine(gaussians, 100);
  REQUIRE(plan.changes());
  Buffer<std::uint32_t> source(context, plan.source.size(), "state sources");
  source.upload(plan.state_source());
  adam.remap(source, gaussians.count);
  footprint.update(gaussians);
  return context.peak_allocated_bytes() - before;
}

}  // namespace

TEST_CASE("the state of a training is estimated to two percent") {
  const DeviceInfo device = make_test_context().device();
  for (const int degree : {0, 1, 3}) {
    for (const double share : {0.0, 0.3}) {
      CAPTURE(degree);
      CAPTURE(share);
      TrainOptions options;
      options.iterations = 10000;
      options.sh_degree = degree;
      options.footprint = share;
      Gaussians model = reference::random_scene(20000, 43, degree);
      for (std::size_t i = 0; i < model.size(); i += 100) model.opacities[i] = -20.0f;
      const auto got = static_cast<double>(bytes_of_state(model, options));
      const MemoryEstimate estimate = estimate_memory(options, {model.size(), 64, 3}, device);
      CHECK(static_cast<double>(estimate.gaussians) == doctest::Approx(got).epsilon(0.02));
    }
  }
}

TEST_CASE("a run that is too large is told the most Gaussians that fit, to the last one") {
  TrainOptions options;
  options.iterations = 10000;
  options.trace.memory_budget = std::size_t{256} << 20;
  const MemoryDemand demand{5'000'000, 800 * 800, 100};
  for (const DeviceInfo& device :
       {device_with(std::uint64_t{4} << 30, std::uint64_t{1} << 30),
        device_with(std::uint64_t{64} << 30, std::uint64_t{200} << 20)}) {
    const std::size_t most = gaussians_that_fit(options, demand, device);
    CHECK(most > 100'000);
    CHECK(most < demand.gaussians);
    CHECK(fits(estimate_memory(options, {most, demand.pixels, demand.views}, device), device));
    CHECK(!fits(estimate_memory(options, {most + 1, demand.pixels, demand.views}, device), device));
    CHECK(refusal(options, demand, device).find("--max-gaussians " + std::to_string(most)) !=
          std::string::npos);
    CHECK(refusal(options, {most, demand.pixels, demand.views}, device).empty());
  }
}

TEST_CASE("when not even the images fit, the advice is another") {
  const DeviceInfo tiny = device_with(64 << 20, 64 << 20);
  const std::string message = refusal({}, {1000, 4000 * 3000, 100}, tiny);
  CHECK(message.find("--downscale") != std::string::npos);
  CHECK(message.find("--max-gaussians") == std::string::npos);
}

TEST_CASE("hit lists count up to their budget, exact sums where they may be used") {
  const DeviceInfo gpu = device_with(std::uint64_t{8} << 30, std::uint64_t{2} << 30);
  DeviceInfo cpu = gpu;
  cpu.type = DeviceType::kCpu;
  TrainOptions options;
  options.iterations = 10000;
  const MemoryDemand demand{100'000, 1'000'000, 10};
  options.trace.memory_budget = std::size_t{512} << 20;
  // Copies of gradients have no share on GPUs, and here a small one on CPUs.
  CHECK(estimate_memory(options, demand, gpu).hits == std::size_t{384} << 20);
  cpu.compute_units = 2;
  CHECK(estimate_memory(options, demand, cpu).hits == (std::size_t{384} << 20) + 3 * 6'400'000);
  // Exact sums would take more than the copies that are left.
  options.trace.memory_budget = std::size_t{1} << 20;
  CHECK(estimate_memory(options, demand, cpu).hits == (std::size_t{3} << 18) + 6'400'000);
  options.trace.memory_budget = std::size_t{512} << 20;
  options.trace.max_hits = 2;
  options.trace.packet_width = 8;
  options.trace.deterministic = true;
  CHECK(estimate_memory(options, demand, gpu).hits == (std::size_t{128} << 20) + 2'500'000 * 40);
  const std::size_t exact = estimate_memory(options, demand, gpu).tracing;
  CHECK(exact ==
        estimate_memory(options, demand, cpu).tracing + kExactLineBytes * demand.gaussians);
  options.trace.deterministic = false;
  CHECK(exact ==
        estimate_memory(options, demand, gpu).tracing + kExactLineBytes * demand.gaussians);
  options.trace.gradient_sum = GradientSum::kExact;
  CHECK(exact == estimate_memory(options, demand, cpu).tracing);
}

TEST_CASE("depth maps share the budget of photos, and one more may come for its step") {
  const DeviceInfo gpu = device_with(std::uint64_t{64} << 30, std::uint64_t{16} << 30);
  const std::size_t pixels = 1'000'000, views = 100, map = sizeof(float) * pixels;
  TrainOptions options;
  options.iterations = 10000;
  options.depth_weight = 0.5;
  const auto images = [&](std::size_t maps) {
    return estimate_memory(options, {1000, pixels, views, 0, 0, 1, maps}, gpu).images;
  };
  options.image_budget = 4096;  // room for all
  CHECK(images(60) == images(0) + 60 * map + map);
  options.image_budget = 450;  // for the photos and some of the maps
  CHECK(images(60) == images(0) + 450 * kMiB - views * map + map);
  options.image_budget = 100;
  CHECK(images(views) == images(0) + map);
}

TEST_CASE("what packets take is never more than estimated") {
  const DeviceInfo device = make_test_context().device();
  for (const GradientSum sum : {GradientSum::kCopies, GradientSum::kExact}) {
    // Mostly copies of gradients, then mostly hits and lists.
    for (const auto& [count, width] :
         {std::pair{20000, 24}, std::pair{300, 200}, std::pair{20000, 200}}) {
      CAPTURE(static_cast<int>(sum));
      CAPTURE(count);
      CAPTURE(width);
      TrainOptions options;
      options.iterations = 10000;
      options.sh_degree = 0;
      options.trace.gradient_sum = sum;
      options.trace.memory_budget = std::size_t{64} << 20;
      const auto gaussians = static_cast<std::size_t>(count);
      const std::size_t got =
          bytes_of_packets(reference::random_scene(gaussians, 44, 0), width, options.trace);
      const MemoryEstimate estimate =
          estimate_memory(options, {gaussians, pixel_count(width, width), 3}, device);
      CHECK(got <= estimate.tracing + estimate.hits);
    }
  }
}

TEST_CASE("what views traced ray by ray take is estimated to an eighth") {
  const DeviceInfo device = make_test_context().device();
  for (const int degree : {0, 2}) {
    for (const GradientSum sum : {GradientSum::kCopies, GradientSum::kExact}) {
      for (const bool mirrored : {false, true}) {
        // Mostly Gaussians, then mostly rays.
        for (const auto& [count, width] : {std::pair{20000, 70}, std::pair{500, 300}}) {
          CAPTURE(degree);
          CAPTURE(static_cast<int>(sum));
          CAPTURE(mirrored);
          CAPTURE(count);
          TrainOptions options;
          options.iterations = 10000;
          options.sh_degree = degree;
          options.trace.gradient_sum = sum;
          options.trace.memory_budget = std::size_t{256} << 20;
          if (mirrored) options.mirrors = {"wall.obj"};
          TraceOptions trace;
          trace.gradient_sum = sum;
          trace.memory_budget = std::size_t{256} << 20;
          const auto gaussians = static_cast<std::size_t>(count);
          const std::size_t pixels = pixel_count(width, width);
          const auto got =
              static_cast<double>(bytes_of_rays(reference::random_scene(gaussians, 41, degree),
                                                width, trace, mirrored ? wall() : Mirrors{}));
          const MemoryEstimate estimate = estimate_memory(
              options, {gaussians, pixels, 3, 3, mirrored ? kWallTriangles : 0}, device);
          CHECK(static_cast<double>(estimate.rays) == doctest::Approx(got).epsilon(0.125));
          CHECK(estimate.tracing == 0);
          CHECK(estimate.hits == 0);
        }
      }
    }
  }
}

TEST_CASE("rays one by one count where a view needs them, in batches within their budget") {
  DeviceInfo gpu = device_with(std::uint64_t{8} << 30, std::uint64_t{2} << 30);
  TrainOptions options;
  options.iterations = 10000;
  options.sh_degree = 3;
  const std::size_t gaussians = 100'000, pixels = 10'000'000;
  const MemoryEstimate packets = estimate_memory(options, {gaussians, pixels, 10}, gpu);
  const MemoryEstimate some = estimate_memory(options, {gaussians, pixels, 10, 3}, gpu);
  const MemoryEstimate all = estimate_memory(options, {gaussians, pixels, 10, 10}, gpu);
  CHECK(packets.rays == 0);
  CHECK(some.rays > 0);
  CHECK(some.rays == all.rays);
  CHECK(some.total() == packets.total() + all.rays);
  CHECK(all.total() < some.total());
  // 64 sums of 24 bytes more for each Gaussian.
  options.trace.deterministic = true;
  const MemoryEstimate exact = estimate_memory(options, {gaussians, pixels, 10, 10}, gpu);
  CHECK(exact.rays == all.rays + gaussians * 64 * 24);
  CHECK(exact.largest_buffer == 36 * pixels);  // of the loss
  CHECK(estimate_memory(options, {gaussians, pixels / 10, 10, 10}, gpu).largest_buffer ==
        gaussians * 64 * 24);
  options.trace.memory_budget = std::size_t{64} << 20;
  CHECK(estimate_memory(options, {0, pixels, 10, 10}, gpu).rays < std::size_t{64} << 20);
}

TEST_CASE("with bounds a second model is held while the one within them is measured") {
  const DeviceInfo gpu = device_with(std::uint64_t{8} << 30, std::uint64_t{2} << 30);
  TrainOptions options;
  options.sh_degree = 1;
  const MemoryEstimate free = estimate_memory(options, {1000, 10'000, 10}, gpu);
  options.bounds = Bounds{};
  const MemoryEstimate bounded = estimate_memory(options, {1000, 10'000, 10}, gpu);
  CHECK(bounded.gaussians == free.gaussians + 1000 * (3 + 4 + 3 + 1 + 12) * sizeof(float));
}
