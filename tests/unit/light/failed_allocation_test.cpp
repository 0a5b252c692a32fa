// SPDX-License-Identifier: Apache-2.0
// What is kept from view to view after the device had no memory for one of them.
#include <doctest/doctest.h>

#include <cstddef>
#include <vector>

#include "raysplats/tracer.hpp"
#include "unit/failed_allocation.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

TEST_CASE("views after an allocation that failed are right, of the former model and the new one") {
  Context context = make_test_context();
  const DeviceGaussians former =
      DeviceGaussians::upload(context, reference::random_scene(40, 7, 1), ScaleActivation::kExp);
  const DeviceGaussians large =
      DeviceGaussians::upload(context, reference::random_scene(900, 8, 1), ScaleActivation::kExp);
  const Camera small_view = reference::cube_camera(20, 12);
  const Camera large_view = reference::cube_camera(60, 44);
  const std::vector<float> gradient = random_image_gradient(60 * 44, 3);
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    CAPTURE(static_cast<int>(traversal));
    TraceOptions options;
    options.traversal = traversal;
    options.deterministic = true;
    ViewTracer fresh(context, options);
    const Traced expected = trace_and_differentiate(context, fresh, large, large_view, gradient);
    ViewTracer other(context, options);
    other.forward(former, small_view);
    const Image expected_former = other.download_image();
    for (const bool goes_back : {false, true}) {
      CAPTURE(goes_back);
      bool failed = true;
      for (std::size_t n = 1; failed; ++n) {
        CAPTURE(n);
        ViewTracer tracer(context, options);
        tracer.forward(former, small_view);
        failed = fails_at(context, n, [&] {
          trace_and_differentiate(context, tracer, large, large_view, gradient);
        });
        if (goes_back) {
          tracer.forward(former, small_view);
          CHECK(tracer.download_image().data == expected_former.data);
        }
        const Traced got = trace_and_differentiate(context, tracer, large, large_view, gradient);
        CHECK(got.image.data == expected.image.data);
        CHECK(got.gradients == expected.gradients);
      }
    }
  }
}

TEST_CASE("normals after an allocation that failed are right") {
  Context context = make_test_context();
  const Model former(context, reference::random_scene(40, 7, 0));
  const Model large(context, reference::random_scene(300, 8, 0));
  const Camera camera = reference::cube_camera(20, 12);
  const auto normals = [&](Tracer& tracer, const Model& model) {
    return tracer.normals(model, camera).data;
  };
  Tracer fresh(context);
  const std::vector<float> expected_former = normals(fresh, former);
  const std::vector<float> expected = normals(fresh, large);
  bool failed = true;
  for (std::size_t n = 1; failed; ++n) {
    CAPTURE(n);
    Tracer tracer(context);
    normals(tracer, former);
    failed = fails_at(context, n, [&] { normals(tracer, large); });
    CHECK(normals(tracer, former) == expected_former);
    CHECK(normals(tracer, large) == expected);
  }
}
