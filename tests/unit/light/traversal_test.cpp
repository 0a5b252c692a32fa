// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>

#include "unit/light/view_fixture.hpp"

using namespace raysplats;

TEST_CASE("camera rays through the tree have the picture and the gradients of the tiles") {
  Context context = make_test_context();
  Camera camera = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 60, 52, 80);
  for (const int degree : {0, 3}) {
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      for (const float near : {0.0f, 3.7f}) {
        CAPTURE(degree);
        CAPTURE(static_cast<int>(order));
        CAPTURE(near);
        const Gaussians model = reference::random_scene(900, 78, degree);
        const DeviceGaussians gaussians =
            DeviceGaussians::upload(context, model, ScaleActivation::kExp);
        TraceOptions options;
        options.hit_order = order;
        options.near_depth = near;
        options.background = {0.3f, 0.2f, 0.1f};
        // Rays on which single precision may decide otherwise pull at nothing.
        const reference::Render expected =
            reference::render(reference::Parameters(model), options, camera);
        std::vector<float> gradient = random_image_gradient(expected.pixels(), 7);
        std::size_t compared = 0;
        for (std::size_t i = 0; i < expected.pixels(); ++i) {
          const bool tie = expected.margin[i] < 1e-4;
          compared += tie ? 0 : 1;
          for (std::size_t c = 0; c < 4 && tie; ++c) gradient[c * expected.pixels() + i] = 0.0f;
        }
        CHECK(2 * compared > expected.pixels());
        options.traversal = Traversal::kTiles;
        ViewTracer tiles(context, options);
        options.traversal = Traversal::kBvh;
        ViewTracer tree(context, options);
        CHECK_FALSE(tiles.by_rays(camera));
        CHECK(tree.by_rays(camera));
        const Traced a = trace_and_differentiate(context, tiles, gaussians, camera, gradient);
        const Traced b = trace_and_differentiate(context, tree, gaussians, camera, gradient);
        CHECK(compare(a.image, expected).maximum < 2e-3);
        CHECK(compare(b.image, expected).maximum < 2e-3);
        CHECK_ERRORS(errors_of(b.gradients, a.gradients), 1e-3);
      }
    }
  }
}

TEST_CASE("every traversal gives the same picture, depth and near plane [small]") {
  Context context = make_test_context();
  for (const int degree : {0, 3}) {
    const Gaussians model = reference::random_scene(500, 47, degree);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    for (const CameraModel lens :
         {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye}) {
      for (const float near : {0.0f, 2.4f}) {
        CAPTURE(degree);
        CAPTURE(static_cast<int>(lens));
        CAPTURE(near);
        TraceOptions options;
        options.near_depth = near;
        options.background = {0.1f, 0.3f, 0.5f};
        options.depth = true;
        std::vector<Image> images, depths;
        for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
          options.traversal = traversal;
          ViewTracer tracer(context, options);
          tracer.forward(gaussians, view_of(lens, 64, 48, 40));
          images.push_back(tracer.download_image());
          depths.push_back(tracer.download_depth());
        }
        double mean = 0, covered = 0;
        std::size_t other = 0;
        for (std::size_t i = 0; i < images[0].pixels(); ++i) {
          float worst = 0;
          for (std::size_t c = 0; c < 4; ++c) {
            const float a = images[0].data[4 * i + c], b = images[1].data[4 * i + c];
            worst = std::max(worst, std::abs(a - b));
          }
          const float a = depths[0].data[3 * i], b = depths[1].data[3 * i];
          other += worst > 1e-3f || std::abs(a - b) > 1e-3f * std::max(a, b) ? 1 : 0;
          mean += static_cast<double>(worst);
          covered += images[0].data[4 * i + 3] > 0.5f ? 1 : 0;
        }
        const auto pixels = static_cast<double>(images[0].pixels());
        CHECK(mean / pixels < 2e-5);
        CHECK(static_cast<double>(other) * 500 < pixels);
        CHECK(covered * 10 > pixels);
      }
    }
  }
}

TEST_CASE("traversal auto is what the tuning says [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(100, 48, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = view_of(CameraModel::kPinhole, 24, 24, 20);
  const auto picture = [&](Traversal traversal) {
    TraceOptions options;
    options.traversal = traversal;
    ViewTracer tracer(context, options);
    tracer.forward(gaussians, camera);
    return tracer.download_image().data;
  };
  const std::vector<float> tiles = picture(Traversal::kTiles), bvh = picture(Traversal::kBvh);
  REQUIRE(tiles != bvh);  // in their last bits
  CHECK(picture(Traversal::kAuto) == tiles);
  DeviceTuning tuning;
  tuning.bvh = true;
  context.set_tuning(tuning);
  CHECK(picture(Traversal::kAuto) == bvh);
}
