// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdlib>
#include <vector>

#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

// What a view leaves behind.
struct Traced {
  Image image;
  std::vector<float> means;
  std::vector<float> sh;
  std::uint64_t candidates = 0;
  std::uint64_t hits = 0;

  bool operator==(const Traced& other) const {
    return image.data == other.image.data && means == other.means && sh == other.sh &&
           candidates == other.candidates && hits == other.hits;
  }
};

struct Scene {
  Scene(Context& context_in, const TraceOptions& options)
      : context(context_in),
        gaussians(DeviceGaussians::upload(
            context_in, reference::random_scene(3000, 71, 1), ScaleActivation::kExp)),
        tracer(context_in, options),
        image_gradient(context_in, 4 * 256 * 256, "image gradient") {
    tracer.update(gaussians);
    image_gradient.upload(random_image_gradient(256 * 256, 5));
  }

  void trace(const Camera& camera, ViewSizes sizes) {
    tracer.forward(gaussians, camera, true, sizes);
    tracer.backward(gaussians, image_gradient, gradients);
  }
  Traced result() {
    const CameraTracer::Statistics statistics = tracer.statistics();
    return {tracer.download_image(), gradients.means.download(), gradients.sh.download(),
            statistics.candidates, statistics.hits};
  }

  Context& context;
  DeviceGaussians gaussians;
  CameraTracer tracer;
  Buffer<float> image_gradient;
  GaussianGradients gradients;
};

TraceOptions options_of(const Packet& packet) {
  TraceOptions options;
  options.gradient_sum = GradientSum::kExact;
  options.background = {0.25f, 0.5f, 0.75f};
  return packet.over(options);
}

void check_nothing_seen(Scene& scene) {
  const Traced nothing = scene.result();
  CHECK(scene.tracer.overflow().read(0) == 1);
  CHECK(nothing.hits == 0);
  for (std::size_t i = 0; i < nothing.image.pixels(); ++i) {
    REQUIRE(nothing.image.data[4 * i] == 0.25f);
    REQUIRE(nothing.image.data[4 * i + 3] == 0.0f);
  }
  for (const float number : nothing.means) REQUIRE(number == 0.0f);
}

}  // namespace

TEST_CASE("a view is the same with sizes that are waited for and with any room that is enough") {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(97, 61);
  for (const Packet& packet : packets({8}, {32})) {
    CAPTURE(packet);
    Scene exact(context, options_of(packet));
    exact.trace(camera, ViewSizes::kAwaited);
    const Traced expected = exact.result();
    CHECK(expected.hits > 10000);
    // The same view again: hardly more room than it needs. After a larger one: many times that.
    Scene roomy(context, options_of(packet));
    roomy.trace(reference::cube_camera(256, 256), ViewSizes::kAwaited);
    for (Scene* scene : {&exact, &roomy}) {
      const std::uint64_t waits = context.host_waits();
      scene->trace(camera, ViewSizes::kAhead);
      CHECK(context.host_waits() == waits);
      CHECK(scene->tracer.overflow().read(0) == 0);
      CHECK(scene->result() == expected);
    }
  }
}

TEST_CASE("a view without room shows nothing, as those after it, until the overflow is cleared") {
  Context context = make_test_context();
  const Camera small = reference::cube_camera(16, 16);
  const Camera large = reference::cube_camera(256, 256);
  for (const Packet& packet : packets({8}, {32})) {
    CAPTURE(packet);
    Scene scene(context, options_of(packet));
    scene.trace(large, ViewSizes::kAwaited);
    const Traced expected = scene.result();
    Scene tight(context, options_of(packet));
    tight.trace(small, ViewSizes::kAwaited);
    const Traced first = tight.result();
    tight.trace(large, ViewSizes::kAhead);
    CHECK(tight.tracer.overflow().read(0) == 1);
    tight.trace(small, ViewSizes::kAhead);
    check_nothing_seen(tight);
    tight.tracer.clear_overflow();
    tight.trace(large, ViewSizes::kAwaited);
    CHECK(tight.result() == expected);
    tight.trace(small, ViewSizes::kAhead);
    CHECK(tight.result() == first);
  }
}

TEST_CASE("lists and hits without room are noticed each by itself") {
  const Camera camera = reference::cube_camera(97, 61);
  for (const char* fault : {"RAYSPLATS_FAIL_LISTS", "RAYSPLATS_FAIL_HITS"}) {
    CAPTURE(fault);
    ::setenv(fault, "1", 1);
    Context context = make_test_context();
    ::unsetenv(fault);
    Scene scene(context, options_of({PacketShape::kVector, 8}));
    scene.trace(camera, ViewSizes::kAwaited);
    const Traced expected = scene.result();
    scene.trace(camera, ViewSizes::kAhead);
    CHECK(scene.tracer.overflow().read(0) == 1);
    for (const float number : scene.gradients.means.download()) REQUIRE(number == 0.0f);
    scene.tracer.clear_overflow();
    scene.trace(camera, ViewSizes::kAhead);
    CHECK(scene.result() == expected);
  }
}

TEST_CASE("where the memory budget has no room for a view, its sizes are waited for") {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(97, 61);
  TraceOptions options = options_of({PacketShape::kVector, 8});
  options.memory_budget = 1 << 19;
  Scene scene(context, options);
  for (int i = 0; i < 2; ++i) {
    const std::uint64_t waits = context.host_waits();
    scene.trace(camera, ViewSizes::kAhead);
    CHECK(context.host_waits() > waits);
    CHECK(scene.tracer.overflow().read(0) == 0);
  }
}
