// SPDX-License-Identifier: Apache-2.0
// Calls of Tracer that a function watches, which may stop them or throw.
#include <doctest/doctest.h>

#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/tracer.hpp"
#include "unit/light/ray_result_gradient.hpp"
#include "unit/text.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;
using test::message_of;

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

}  // namespace

TEST_CASE("a picture can be stopped while it is drawn") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(60, 43, 0));
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    TraceOptions options;
    options.traversal = traversal;
    Tracer tracer(context, options);
    const Camera camera = reference::cube_camera(800, 600);
    std::size_t heard = 0;
    const Image stopped = tracer.render(model, camera, false, [&](double share) {
      CHECK(share > 0.0);
      CHECK(share <= 1.0);
      return ++heard < 2;
    });
    if (heard >= 2) CHECK(stopped.data.empty());
    const Image whole = tracer.render(model, camera, false, [](double) { return true; });
    CHECK(whole.data == tracer.render(model, camera).data);
    CHECK(tracer.render(model, camera, false, [](double) { return false; }).data.empty());
    CHECK_THROWS_AS(tracer.depth(), UsageError);
  }
}

TEST_CASE("rays can be stopped while they are traced and while their gradients are taken") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(60, 43, 1));
  for (const bool in_batches : {true, false}) {
    CAPTURE(in_batches);
    const int least = in_batches ? 3 : 1;
    TraceOptions options;
    if (in_batches) options.memory_budget = 1000;
    Tracer tracer(context, options);
    const std::vector<Ray> rays = random_rays(10000, 38, 2.0, 0.5, kInfinity);
    std::vector<RayResultGradient> gradients(rays.size());
    CounterRng rng(44, 1);
    for (RayResultGradient& gradient : gradients) gradient = random_gradient(rng);
    const std::vector<RayResult> expected = tracer.trace(model, rays, ColorDirection::kRay, true);
    const RaysGradients wanted = tracer.backward(model, gradients);

    // To the end: shares grow up to 1, and nothing else changes.
    double last = 0;
    int heard = 0;
    const auto listen = [&](double share) {
      CHECK(share >= last);
      last = share;
      ++heard;
      return true;
    };
    const std::vector<RayResult> results =
        tracer.trace(model, rays, ColorDirection::kRay, true, listen);
    CHECK(last == 1.0);
    CHECK(heard >= least);
    REQUIRE(results.size() == rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i) {
      REQUIRE(results[i].color[1] == expected[i].color[1]);
      REQUIRE(results[i].hits == expected[i].hits);
    }
    last = 0;
    heard = 0;
    const RaysGradients got = tracer.backward(model, gradients, listen);
    CHECK(last == 1.0);
    CHECK(heard >= least);
    REQUIRE(got.rays.size() == rays.size());
    for (std::size_t i = 0; i < rays.size(); ++i)
      REQUIRE(got.rays[i].origin[0] == wanted.rays[i].origin[0]);
    if (context.device().type == DeviceType::kCpu)
      CHECK(got.parameters.means == wanted.parameters.means);

    // Stopped: there is nothing, and the gradients of what was traced may be asked for again.
    int calls = 0;
    const auto stop = [&](double) { return ++calls < 1; };
    const RaysGradients none = tracer.backward(model, gradients, stop);
    CHECK(calls == 1);
    CHECK(none.rays.empty());
    CHECK(none.parameters.size() == 0);
    const RaysGradients again = tracer.backward(model, gradients);
    REQUIRE(again.rays.size() == rays.size());
    if (context.device().type == DeviceType::kCpu)
      CHECK(again.parameters.means == wanted.parameters.means);
    calls = 0;
    CHECK(tracer.trace(model, rays, ColorDirection::kRay, true, stop).empty());
    CHECK(calls == 1);
    CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
    CHECK(tracer.capped_rays() == 0);

    // What it throws comes out, and it uses other tracers, not this one.
    CHECK_THROWS_AS(tracer.trace(model, rays, ColorDirection::kRay, true,
                                 [](double) -> bool { throw std::out_of_range("of the watch"); }),
                    std::out_of_range);
    CHECK_THROWS_AS(tracer.backward(model, gradients), UsageError);
    Tracer other(context, options);
    const auto within = [&](double) {
      CHECK_THROWS_AS(tracer.trace(model, rays), UsageError);
      return other.trace(model, std::span(rays).first(10)).size() == 10;
    };
    CHECK(tracer.trace(model, rays, ColorDirection::kRay, false, within).size() == rays.size());
  }
}

TEST_CASE("what a watch throws comes out, and leaves the tracer without a picture [small]") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(60, 43, 0));
  const Camera camera = reference::cube_camera(24, 18);
  Camera parallel = camera;
  parallel.model = CameraModel::kOrthographic;
  parallel.fx = parallel.fy = 9.0;
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    TraceOptions options;
    options.traversal = traversal;
    options.depth = true;
    Tracer tracer(context, options);
    for (const Camera& view : {camera, parallel}) {
      if (view.model == CameraModel::kOrthographic && traversal == Traversal::kTiles) continue;
      const Image expected = tracer.render(model, view, true);
      int calls = 0;
      {
        const auto owned = std::make_unique<int>(0);
        CHECK_THROWS_AS(tracer.render(model, view, true,
                                      [&, number = owned.get()](double) -> bool {
                                        *number = ++calls;
                                        throw std::out_of_range("of the watch");
                                      }),
                        std::out_of_range);
      }
      CHECK(calls == 1);
      CHECK_THROWS_AS(tracer.depth(), UsageError);
      CHECK_THROWS_AS(tracer.backward(model, Image(24, 18, 4)), UsageError);
      // An error of the library's own is not taken for a picture that was stopped.
      CHECK_THROWS_AS(tracer.render(model, view, false,
                                    [](double) -> bool { throw DataError("of the watch"); }),
                      DataError);
      CHECK(tracer.render(model, view, true).data == expected.data);
      CHECK(calls == 1);
      CHECK_NOTHROW(tracer.backward(model, Image(24, 18, 4)));
    }
  }
}

TEST_CASE("a tracer refuses to work for what watches it [small]") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(60, 43, 0));
  const Camera camera = reference::cube_camera(24, 18);
  const std::vector<Ray> rays = random_rays(5, 38, 2.0, 0.5, kInfinity);
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    TraceOptions options;
    options.traversal = traversal;
    Tracer tracer(context, options), other(context, options);
    const Image expected = tracer.render(model, camera);
    int calls = 0;
    const auto watch = [&](double) {
      ++calls;
      CHECK(message_of<UsageError>([&] { tracer.render(model, camera); }).find("is rendering") !=
            std::string::npos);
      CHECK_THROWS_AS(tracer.normals(model, camera), UsageError);
      CHECK_THROWS_AS(tracer.trace(model, rays), UsageError);
      CHECK_THROWS_AS(tracer.backward(model, Image(24, 18, 4)), UsageError);
      CHECK_THROWS_AS(tracer.backward(model, std::vector<RayResultGradient>(5)), UsageError);
      CHECK(other.render(model, camera).data == expected.data);
      return true;
    };
    CHECK(tracer.render(model, camera, true, watch).data == expected.data);
    CHECK(calls > 0);
    CHECK_NOTHROW(tracer.backward(model, Image(24, 18, 4)));
    calls = 0;
    CHECK_FALSE(tracer.normals(model, camera, watch).data.empty());
    CHECK(calls > 0);
    CHECK(tracer.trace(model, rays).size() == rays.size());
  }
}
