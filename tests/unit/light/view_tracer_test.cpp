// SPDX-License-Identifier: Apache-2.0
#include "light/view_tracer.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

TEST_CASE("a pinhole's gradients ray by ray are those of packets") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(800, 91, 2);
  const Camera camera = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 66, 58, 80);
  TraceOptions options;
  options.background = {0.3f, 0.2f, 0.1f};
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const reference::Render render = reference::render(reference::Parameters(model), options, camera);
  std::vector<float> gradient = random_image_gradient(render.pixels(), 5);
  for (std::size_t i = 0; i < render.pixels(); ++i) {
    if (render.margin[i] >= 1e-4) continue;
    for (std::size_t c = 0; c < 4; ++c) gradient[c * render.pixels() + i] = 0.0f;
  }
  ViewTracer packets(context, options), rays(context, options);
  const Traced expected = trace_and_differentiate(context, packets, gaussians, camera, gradient);
  const Traced got = trace_and_differentiate(context, rays, gaussians, camera, gradient, true);
  CHECK(compare(got.image, render).maximum < 2e-3);
  CHECK_ERRORS(errors_of(got.gradients, expected.gradients), 1e-3);

  // In batches that are traced again; 58 x 66 pixels are less than one.
  const Camera large = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 110, 90, 150);
  const std::vector<float> noise = random_image_gradient(110 * 90, 6);
  TraceOptions tight = options;
  tight.memory_budget = 1000;
  ViewTracer batches(context, tight);
  const Traced whole = trace_and_differentiate(context, rays, gaussians, large, noise, true);
  const Traced parts = trace_and_differentiate(context, batches, gaussians, large, noise, true);
  CHECK(whole.image.data == parts.image.data);
  CHECK_ERRORS(errors_of(parts.gradients, whole.gradients), 1e-4);
  // Exact sums do not notice the batches.
  options.gradient_sum = tight.gradient_sum = GradientSum::kExact;
  ViewTracer exact(context, options), exact_batches(context, tight);
  CHECK(trace_and_differentiate(context, exact, gaussians, large, noise, true).gradients ==
        trace_and_differentiate(context, exact_batches, gaussians, large, noise, true).gradients);
}

TEST_CASE("the gradients of a picture by rays do not depend on whether somebody watches it") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(12, 23, 0), ScaleActivation::kExp);
  // More pixels than a batch has of a picture that is watched.
  const Camera camera = view_of(CameraModel::kPinhole, 260, 256, 240);
  Buffer<float> gradient(context, 4 * 260 * 256, "image gradient");
  gradient.upload(random_image_gradient(260 * 256, 8));
  TraceOptions bare;
  bare.traversal = Traversal::kBvh;
  bare.gradient_sum = GradientSum::kExact;  // the same sum in any batches
  REQUIRE(ViewTracer::batch(bare, context.device()) > 260 * 256);
  TraceOptions sky = bare;
  sky.sky = {{0.1f, 0.2f, 0.3f}};
  const Mirrors mirror = mirrors_of({{{-3, -3, 1.5}, {6, 0, 0}, {0, 6, 0}, {1, 1, 1}}}, 1);
  for (const auto& [options, mirrors] :
       {std::pair{bare, Mirrors{}}, {sky, Mirrors{}}, {bare, mirror}}) {
    CAPTURE(options.sky.size());
    CAPTURE(mirrors.meshes.size());
    ViewTracer tracer(context, options, mirrors);
    const bool posed = options.sky.empty() && mirrors.meshes.empty();
    const auto gradients = [&](bool watch_forward, bool watch_backward, PoseGradient& pose) {
      const auto watch = [&](bool watched) {
        tracer.set_watch(watched ? [](double) { return true; } : std::function<bool(double)>());
      };
      watch(watch_forward);
      tracer.forward(gaussians, camera, true);
      watch(watch_backward);
      GaussianGradients out;
      tracer.backward(gaussians, gradient, out, posed ? &pose : nullptr);
      return HostGradients(out);
    };
    PoseGradient expected_pose, pose;
    const HostGradients expected = gradients(false, false, expected_pose);
    CHECK(gradients(true, false, pose) == expected);
    if (!posed) continue;
    CHECK(gradients(false, true, pose) == expected);
    for (std::size_t k = 0; k < 3; ++k) {
      CHECK(pose.center[k] == doctest::Approx(expected_pose.center[k]));
      CHECK(pose.rotation[k] == doctest::Approx(expected_pose.rotation[k]));
    }
  }
}

TEST_CASE("parts of a picture have its pixels, and nobody traces another's") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(300, 17, 1), ScaleActivation::kExp);
  const Camera pinhole = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 50, 58, 70);
  for (const auto& [camera, traversal] : {std::pair{pinhole, Traversal::kTiles},
                                          {pinhole, Traversal::kBvh},
                                          {fisheye_camera(160, 160), Traversal::kTiles}}) {
    CAPTURE(static_cast<int>(traversal));
    CAPTURE(static_cast<int>(camera.model));
    TraceOptions options;
    options.traversal = traversal;
    ViewTracer tracer(context, options);
    tracer.forward(gaussians, camera);
    const Image black = tracer.download_image();
    tracer.set_background({0.2f, 0.7f, 0.4f});
    tracer.forward(gaussians, camera);
    const Image green = tracer.download_image();
    const std::uint64_t hits = tracer.statistics().hits;
    // Also more parts than rows of tiles.
    for (const std::size_t parts : {1u, 3u, 7u}) {
      CAPTURE(parts);
      int row = 0;
      std::uint64_t sum = 0;
      for (std::size_t part = 0; part < parts; ++part) {
        tracer.set_share(0, 1);
        tracer.set_background({});
        tracer.forward(gaussians, camera);
        tracer.set_share(part, parts);
        tracer.set_background({0.2f, 0.7f, 0.4f});
        tracer.forward(gaussians, camera);
        sum += tracer.statistics().hits;
        const auto [first, last] = tracer.rows();
        CHECK(first == row);
        row = last;
        const Image got = tracer.download_image();
        const auto begin = static_cast<std::ptrdiff_t>(4 * camera.width * first);
        const auto end = static_cast<std::ptrdiff_t>(4 * camera.width * last);
        std::vector<float> expected = black.data;
        std::copy(green.data.begin() + begin, green.data.begin() + end, expected.begin() + begin);
        CHECK(got.data == expected);
      }
      CHECK(row == camera.height);
      CHECK(sum == hits);
    }
  }
}

TEST_CASE("reflected rays are counted, of which max_hits may stop each as well") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(300, 17, 0), ScaleActivation::kExp);
  TraceOptions options;
  options.max_hits = 1;
  const Camera camera = view_of(CameraModel::kPinhole, 260, 256, 240);
  const std::uint64_t pixels = 260 * 256;
  // Two mirrors that face each other: one behind the cloud, one behind the camera.
  const Mirrors mirrors = mirrors_of({{{-50, -50, 1.5}, {100, 0, 0}, {0, 100, 0}, {1, 1, 1}},
                                      {{-50, -50, -9}, {100, 0, 0}, {0, 100, 0}, {1, 1, 1}}},
                                     2);
  ViewTracer tracer(context, options, mirrors);
  CHECK(tracer.reflected_rays() == 0);
  tracer.set_watch([](double) { return true; });  // in batches
  tracer.forward(gaussians, camera);
  CHECK(tracer.reflected_rays() == 2 * pixels);
  CHECK(tracer.capped_rays() <= pixels + tracer.reflected_rays());
  ViewTracer bare(context, options);
  bare.forward(gaussians, camera);
  CHECK(bare.reflected_rays() == 0);
}

TEST_CASE("what a tracer of rays refuses, and a tree that is refitted") {
  Context context = make_test_context();
  TraceOptions near;
  near.near_depth = 0.5f;
  TraceOptions deep;
  deep.depth = true;
  CHECK_THROWS_AS(
      ViewTracer(context, deep, mirrors_of({{{-2, -2, 1}, {4, 0, 0}, {0, 4, 0}, {1, 1, 1}}}, 1)),
      UsageError);
  const Panel panel{{-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, glm::dvec3(1)};
  CHECK_THROWS_AS(ViewTracer(context, near, mirrors_of({panel}, 1)), UsageError);
  CHECK_NOTHROW(ViewTracer(context, near));
  Mirrors endless;
  endless.max_bounces = -1;
  CHECK_THROWS_AS(ViewTracer(context, {}, endless), UsageError);
  ViewTracer tracer(context, {});
  Gaussians model = reference::random_scene(300, 94, 0);
  const Camera camera = fisheye_camera(30, 30);
  Buffer<float> gradient(context, 4 * 900, "image gradient");
  gradient.clear();
  GaussianGradients out;
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions tiled;
  tiled.traversal = Traversal::kTiles;
  CHECK_THROWS_AS(ViewTracer(context, tiled, mirrors_of({panel}, 1)), UsageError);
  ViewTracer tiles(context, tiled);
  Camera flat = camera;
  flat.model = CameraModel::kOrthographic;
  CHECK_THROWS_AS(tiles.forward(gaussians, flat), UsageError);
  tracer.forward(gaussians, camera);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  CHECK(tracer.capped_rays() == 0);
  // Many small changes: the tree is refitted most of the times.
  CounterRng rng(95, 1);
  for (int round = 0; round < 40; ++round) {
    for (float& x : model.means) x += static_cast<float>(0.01 * rng.normal());
    gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    tracer.forward(gaussians, camera, true);
  }
  ViewTracer fresh(context, {});
  fresh.forward(gaussians, camera);
  CHECK(fresh.download_image().data == tracer.download_image().data);

  // The same count with other parameters is another model.
  tracer.backward(gaussians, gradient, out);
  gaussians.opacities.fill(0);
  gaussians.changed(context);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  Camera pinhole = camera;
  pinhole.model = CameraModel::kPinhole;
  tracer.forward(gaussians, pinhole, true);
  gaussians.changed(context);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  tracer.forward(gaussians, pinhole, true);
  Buffer<float> small(context, 8, "small");
  CHECK_THROWS_AS(tracer.backward(gaussians, small, out), UsageError);
  CHECK_NOTHROW(tracer.backward(gaussians, gradient, out));
}

TEST_CASE("a pinhole's picture ray by ray equals the one of packets, depth and all [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(600, 41, 2);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    CAPTURE(static_cast<int>(order));
    TraceOptions options;
    options.hit_order = order;
    options.background = {0.1f, 0.3f, 0.5f};
    options.depth = true;
    // So little that the rays come in several batches.
    options.memory_budget = 1 << 20;
    ViewTracer tracer(context, options);
    const Camera camera = view_of(CameraModel::kPinhole, 120, 90, 100);
    tracer.forward(gaussians, camera);
    const Image packets = tracer.download_image();
    const Image packet_depth = tracer.download_depth();
    tracer.forward_rays(gaussians, camera);
    const Image rays = tracer.download_image();
    const Image ray_depth = tracer.download_depth();
    REQUIRE(rays.data.size() == packets.data.size());
    REQUIRE(ray_depth.data.size() == packet_depth.data.size());
    double mean = 0;
    std::size_t other = 0, other_depth = 0, other_hits = 0, covered = 0;
    for (std::size_t i = 0; i < packets.pixels(); ++i) {
      float worst = 0;
      for (std::size_t c = 0; c < 4; ++c) {
        const float difference = std::abs(rays.data[4 * i + c] - packets.data[4 * i + c]);
        worst = std::max(worst, difference);
        mean += static_cast<double>(difference) / static_cast<double>(packets.data.size());
      }
      other += worst > 1e-3f ? 1 : 0;
      const float a = ray_depth.data[3 * i], b = packet_depth.data[3 * i];
      other_depth += std::abs(a - b) > 1e-3f * std::max(a, b) ? 1 : 0;
      other_hits += ray_depth.data[3 * i + 2] == packet_depth.data[3 * i + 2] ? 0 : 1;
      covered += packets.data[4 * i + 3] > 0.5f ? 1 : 0;
    }
    // Single precision decides near-ties in order and at outlines either way.
    CHECK(mean < 1e-5);
    CHECK(other * 500 < packets.pixels());
    CHECK(other_depth * 500 < packets.pixels());
    CHECK(other_hits * 500 < packets.pixels());
    CHECK(covered > 1000);
  }
}

TEST_CASE("cameras that a view cannot be traced from are refused") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(20, 43, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  ViewTracer tracer(context, options);
  Camera camera = view_of(CameraModel::kFisheye, 8, 8, 0);
  CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
  camera.model = CameraModel::kEquirectangular;
  CHECK_NOTHROW(tracer.forward(gaussians, camera));
  options.traversal = Traversal::kTiles;
  ViewTracer tiles(context, options);
  CHECK_THROWS_AS(tiles.forward(gaussians, camera), UsageError);
  CHECK_THROWS_AS(tiles.forward(gaussians, view_of(CameraModel::kOrthographic, 8, 8, 9)),
                  UsageError);
  CHECK_NOTHROW(tiles.forward(gaussians, view_of(CameraModel::kPinhole, 8, 8, 9)));
}

TEST_CASE("rays that stop at the cap on hits are told of the last view, on the device as well") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 96, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = fisheye_camera(90, 80);
  const Camera pinhole = reference::cube_camera(50, 40);
  TraceOptions options;
  options.max_hits = 3;
  options.memory_budget = 1 << 16;  // several batches of rays, which backward() traces again
  REQUIRE(ViewTracer::batch(options, context.device()) < 90 * 80);
  ViewTracer tracer(context, options);
  tracer.forward(gaussians, camera);
  const std::uint64_t by_rays = tracer.capped_rays();
  tracer.forward(gaussians, pinhole);
  const std::uint64_t by_packets = tracer.capped_rays();
  CHECK(by_rays > 200);
  CHECK(by_packets > 200);
  const auto kept = [&tracer] {
    const ViewTracer::CappedRays capped = tracer.capped_on_device();
    const std::vector<std::uint32_t> words = capped.words.download();
    return words[capped.place] + (capped.wide ? std::uint64_t{words[capped.place + 1]} << 32 : 0);
  };
  CHECK(kept() == by_packets);
  Buffer<float> gradient(context, 4 * 90 * 80, "image gradient");
  gradient.clear();
  GaussianGradients out;
  for (int repetition = 0; repetition < 2; ++repetition) {
    tracer.forward(gaussians, camera, true);
    CHECK(kept() == by_rays);
    tracer.backward(gaussians, gradient, out);
    CHECK(tracer.capped_rays() == by_rays);
    tracer.forward(gaussians, pinhole, true);
    CHECK(kept() == by_packets);
    tracer.backward(gaussians, gradient, out);  // traces bands again
    tracer.forward(gaussians, camera);          // of an evaluation
    CHECK(tracer.capped_rays() == by_rays);
    CHECK(kept() == by_rays);
  }
}
