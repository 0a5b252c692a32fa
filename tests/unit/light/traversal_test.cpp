// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "scene/camera/camera_model.hpp"
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

TEST_CASE("every traversal shows the footprint of a view, through every lens") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(500, 48, 2);
  for (float& scale : model.log_scales) scale -= 2.0f;  // most of them thinner than a pixel
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const CameraModel lens : {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye,
                                 CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    CAPTURE(static_cast<int>(lens));
    const Camera camera = view_of(lens, 48, 36, lens == CameraModel::kOrthographic ? 12 : 30);
    const auto draw = [&](Traversal traversal, float footprint) {
      TraceOptions options = peak_order();
      options.view_footprint = footprint;
      options.traversal = traversal;
      ViewTracer tracer(context, options);
      tracer.forward(gaussians, camera);
      return tracer.download_image();
    };
    const Image tree = draw(Traversal::kBvh, 0.5f), bare = draw(Traversal::kBvh, 0.0f);
    double shown = 0, apart = 0, by_footprint = 0;
    for (std::size_t i = 0; i < tree.pixels(); ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        shown += std::abs(static_cast<double>(tree.data[4 * i + c]));
        by_footprint += std::abs(static_cast<double>(tree.data[4 * i + c]) - bare.data[4 * i + c]);
      }
    }
    CHECK(by_footprint > 0.05 * shown);
    if (lens != CameraModel::kOrthographic && lens != CameraModel::kEquirectangular) {
      // Views take the size of a pixel from where the mean is, cones from where the ray is beside
      // it.
      const Image tiles = draw(Traversal::kTiles, 0.5f);
      for (std::size_t i = 0; i < tree.data.size(); ++i)
        apart += std::abs(static_cast<double>(tree.data[i]) - tiles.data[i]);
      CHECK(apart < 1e-2 * shown);
      CHECK(apart < 0.1 * by_footprint);
    }
    TraceOptions options = peak_order();
    options.view_footprint = 0.5f;
    const auto prepared = reference::prepare(parameters, options);
    std::size_t compared = 0, wrong = 0;
    for (std::size_t i = 0; i < tree.pixels(); ++i) {
      const auto width = static_cast<std::size_t>(camera.width);
      const CameraRay ray = camera_ray(camera, static_cast<double>(i % width) + 0.5,
                                       static_cast<double>(i / width) + 0.5);
      if (!ray.valid) continue;
      const reference::RayTrace expected = reference::trace_ray(
          parameters, prepared, options, ray.origin, ray.direction, 0.0, 1e30,
          lens == CameraModel::kOrthographic ? reference::ColorMode::kAlongRay
                                             : reference::ColorMode::kFromOrigin,
          reference::pixel_cone(camera, options, ray.direction));
      if (expected.margin < 1e-4) continue;
      ++compared;
      wrong += pixel_error(tree, i, expected.color, expected.alpha) < 2e-3 ? 0 : 1;
    }
    CHECK(wrong == 0);
    CHECK(2 * compared > tree.pixels());
  }
}

TEST_CASE("a picture by rays that is differentiated has no footprint, and those after it have") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(200, 49, 1);
  for (float& scale : model.log_scales) scale -= 2.0f;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = view_of(CameraModel::kPinhole, 24, 18, 20);
  const std::vector<float> gradient = random_image_gradient(pixel_count(camera), 7);
  TraceOptions options = peak_order();
  options.traversal = Traversal::kBvh;
  ViewTracer tracer(context, options);
  options.view_footprint = 0;
  ViewTracer bare(context, options);
  tracer.forward(gaussians, camera);
  const Image shown = tracer.download_image();
  const Traced a = trace_and_differentiate(context, tracer, gaussians, camera, gradient);
  const Traced b = trace_and_differentiate(context, bare, gaussians, camera, gradient);
  CHECK(a.image.data == b.image.data);
  CHECK(a.image.data != shown.data);
  CHECK_ERRORS(errors_of(a.gradients, b.gradients), 1e-6);
  tracer.forward(gaussians, camera);
  CHECK(tracer.download_image().data == shown.data);
}
