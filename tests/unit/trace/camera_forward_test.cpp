// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/matrix.hpp>
#include <limits>

#include "raysplats/error.hpp"
#include "trace/candidate_lists.hpp"
#include "trace/view_sizes.h"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

void check_against_reference(Context& context,
                             const Gaussians& model,
                             const TraceOptions& options,
                             const Camera& camera,
                             ScaleActivation activation = ScaleActivation::kExp) {
  const Image image = trace_image(context, model, options, camera, activation);
  const reference::Render expected =
      reference::render(reference::Parameters(model, activation), options, camera);
  const Difference difference = compare(image, expected);
  INFO("mean ", difference.mean, " max ", difference.maximum, " near-ties ", difference.excused,
       " of ", difference.pixels);
  CHECK(difference.mean < 1e-4);
  CHECK(difference.maximum < 2e-3);
}

void check_every_variant(const Gaussians& model, const Camera& camera) {
  Context context = make_test_context();
  for_every_variant(model, [&](const Gaussians& bounded, const TraceOptions& options,
                               ScaleActivation activation) {
    check_against_reference(context, bounded, options, camera, activation);
  });
}

}  // namespace

TEST_CASE("camera rays equal the double reference in every variant") {
  check_every_variant(reference::random_scene(300, 1, 2), reference::cube_camera(21, 18));
}

TEST_CASE("camera rays of a tiny scene equal the double reference in every variant [small]") {
  check_every_variant(reference::random_scene(24, 1, 1), reference::cube_camera(6, 5));
}

TEST_CASE("of a larger random scene 99.99 % of all pixels equal the double reference") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(2500, 2, 0);
  const Camera camera = reference::cube_camera(125, 120);
  const TraceOptions options;
  const Image image = trace_image(context, model, options, camera);
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  std::size_t outliers = 0;  // near-ties in the order of hits
  for (std::size_t i = 0; i < expected.pixels(); ++i) {
    double worst = 0;
    for (std::size_t c = 0; c < 4; ++c) {
      worst = std::max(worst,
                       std::abs(image.data[4 * i + c] - expected.image[c * expected.pixels() + i]));
    }
    if (worst > 2e-3) ++outliers;
  }
  INFO(outliers, " of ", expected.pixels(), " pixels");
  CHECK(outliers * 10000 <= expected.pixels());
  CHECK(compare(image, expected).mean < 1e-4);
}

TEST_CASE("every SH degree is evaluated as the reference does") {
  Context context = make_test_context();
  for (int degree = 0; degree <= 4; ++degree) {
    CAPTURE(degree);
    check_against_reference(context, reference::random_scene(200, 3, degree), {},
                            reference::cube_camera(33, 17));
  }
}

TEST_CASE("every shape of packet gives the same image") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 4, 1);
  const Camera camera = reference::cube_camera(37, 29);
  TraceOptions options;
  options.packet_width = 1;
  const Image expected = trace_image(context, model, options, camera);
  for (const Packet& packet : packets({2, 4, 8, 16}, {8, 32, 64})) {
    CAPTURE(packet);
    const Image image = trace_image(context, model, packet.over(options), camera);
    double worst = 0;
    for (std::size_t i = 0; i < image.data.size(); ++i) {
      worst = std::max(worst, static_cast<double>(std::abs(image.data[i] - expected.data[i])));
    }
    CHECK(worst < 1e-5);
  }
  options.packet_width = 3;
  CHECK_THROWS_AS(trace_image(context, model, options, camera), UsageError);
}

TEST_CASE("more pending hits than the list holds are still blended in exact order") {
  Context context = make_test_context();
  // 700 thin sheets and coincident copies: every ray meets hundreds of hits whose lower bounds all
  // come first.
  Gaussians model = reference::random_scene(700, 5, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] *= 0.05f;
      model.log_scales[3 * i + k] = std::log(0.4f);
    }
    model.opacities[i] = -5.0f;
    if (i >= 350) {
      for (std::size_t k = 0; k < 3; ++k) model.means[3 * i + k] = model.means[3 * (i - 350) + k];
      for (std::size_t k = 0; k < 4; ++k)
        model.quaternions[4 * i + k] = model.quaternions[4 * (i - 350) + k];
    }
  }
  TraceOptions options;
  options.min_transmittance = 1e-6f;
  options.max_hits = 10000;
  for (const Packet& packet : packets({1, 4, 16}, {32})) {
    CAPTURE(packet);
    const Camera camera = reference::cube_camera(16, 16);
    const Image image = trace_image(context, model, packet.over(options), camera);
    const Difference difference =
        compare(image, reference::render(reference::Parameters(model), options, camera), 0);
    CHECK(difference.mean < 1e-4);
    CHECK(difference.maximum < 2e-3);
  }
}

TEST_CASE("rays that never stop early meet everything, and end behind what is opaque") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(900, 8, 0);
  for (std::size_t i = 0; i < model.size(); ++i) model.opacities[i] = i % 10 == 0 ? 40.0f : 3.0f;
  TraceOptions options;
  options.min_transmittance = 0;
  const Camera camera = reference::cube_camera(24, 16);
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  for (const Packet& packet : packets({1, 4, 16}, {32})) {
    CAPTURE(packet);
    const Difference difference =
        compare(trace_image(context, model, packet.over(options), camera), expected);
    CHECK(difference.mean < 1e-4);
    CHECK(difference.maximum < 2e-3);
  }
}

TEST_CASE("values that no row of the options accepts are refused") {
  Context context = make_test_context();
  const auto refused = [&](auto change) {
    TraceOptions options;
    change(options);
    CHECK_THROWS_AS(CameraTracer(context, options), UsageError);
  };
  refused([](TraceOptions& o) { o.quantile = 0; });
  refused([](TraceOptions& o) { o.quantile = 101; });
  refused([](TraceOptions& o) { o.min_transmittance = -1e-9f; });
  refused([](TraceOptions& o) { o.min_transmittance = 0.6f; });
  refused([](TraceOptions& o) { o.min_transmittance = std::numeric_limits<float>::quiet_NaN(); });
  refused([](TraceOptions& o) { o.max_hits = 0; });
  refused([](TraceOptions& o) { o.near_depth = -1; });
}

TEST_CASE("packets that share a list have more candidates than their queues hold") {
  Context context = make_test_context();
  // 700 faint spheres in a row along the view, each in front of the whole image.
  Gaussians model = reference::random_scene(700, 7, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.means[3 * i] = model.means[3 * i + 1] = 0.0f;
    model.means[3 * i + 2] = -1.0f + 2.0f * static_cast<float>(i * 271 % 700) / 700.0f;
    for (std::size_t k = 0; k < 3; ++k) model.log_scales[3 * i + k] = std::log(0.02f);
    model.opacities[i] = -5.0f;
  }
  Camera camera = reference::cube_camera(24, 16);
  camera.fx = camera.fy = 2400.0;
  TraceOptions options;
  options.max_hits = 10000;
  options.adaptive_radius = false;
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  CHECK(expected.hits == 700 * 24 * 16);
  for (const Packet& packet : packets({1, 2, 4, 8, 16}, {32})) {
    CAPTURE(packet);
    const Difference difference =
        compare(trace_image(context, model, packet.over(options), camera), expected);
    CHECK(difference.mean < 1e-4);
    CHECK(difference.maximum < 2e-3);
  }
}

TEST_CASE("the cap on hits is exact and counted") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(500, 6, 0);
  const Camera camera = reference::cube_camera(24, 24);
  TraceOptions options;
  options.max_hits = 7;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  CHECK(expected.capped_rays > 50);
  for (const Packet& packet : packets({1, 16}, {32})) {
    CAPTURE(packet);
    CameraTracer tracer(context, packet.over(options));
    tracer.update(gaussians);
    tracer.forward(gaussians, camera);
    CHECK(compare(tracer.download_image(), expected).maximum < 2e-3);
    CHECK(std::abs(static_cast<double>(tracer.statistics().capped_rays) -
                   static_cast<double>(expected.capped_rays)) <= 2);
    CHECK(std::abs(static_cast<double>(tracer.statistics().hits) -
                   static_cast<double>(expected.hits)) <= 5);
  }
}

TEST_CASE("depth and hit count equal the reference, also where many rows are open") {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(40, 31);
  for (const Gaussians& model :
       {reference::random_scene(400, 7, 0), crowded_scene(50), crowded_scene(80)}) {
    CAPTURE(model.size());
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      TraceOptions options;
      options.depth = true;
      options.hit_order = order;
      const reference::Render expected =
          reference::render(reference::Parameters(model), options, camera);
      for (const Packet& packet : packets({1, 16}, {32})) {
        CAPTURE(packet);
        CameraTracer tracer(context, packet.over(options));
        tracer.update(gaussians);
        tracer.forward(gaussians, camera);
        const Image depth = tracer.download_depth();
        for (std::size_t i = 0; i < expected.pixels(); ++i) {
          if (expected.margin[i] < 1e-5) continue;
          for (std::size_t k = 0; k < 3; ++k) {
            CHECK(depth.data[3 * i + k] ==
                  doctest::Approx(expected.depth[k * expected.pixels() + i]).epsilon(1e-3));
          }
        }
      }
    }
  }
}

TEST_CASE("empty scenes, single pixels and odd sizes [small]") {
  Context context = make_test_context();
  TraceOptions options;
  options.background = {0.1f, 0.2f, 0.3f};
  Gaussians empty;
  const Image image = trace_image(context, empty, options, reference::cube_camera(5, 3));
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    CHECK(image.data[4 * i] == 0.1f);
    CHECK(image.data[4 * i + 1] == 0.2f);
    CHECK(image.data[4 * i + 2] == 0.3f);
    CHECK(image.data[4 * i + 3] == 0.0f);
  }
  const Gaussians model = reference::random_scene(100, 8, 0);
  for (const auto& size : std::vector<std::pair<int, int>>{{1, 1}, {1, 70}, {70, 1}, {33, 2}}) {
    CAPTURE(size.first);
    CAPTURE(size.second);
    for (const PacketShape shape : {PacketShape::kAuto, PacketShape::kGroup}) {
      options.packet_shape = shape;
      check_against_reference(context, model, options,
                              reference::cube_camera(size.first, size.second));
    }
  }
  const Gaussians one = reference::random_scene(1, 9, 0);
  check_against_reference(context, one, options, reference::cube_camera(32, 32));
}

TEST_CASE("a camera inside the scene: means beside and behind it, ellipsoids around it") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(600, 10, 1);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (int i = 0; i < 4; ++i) {
      CAPTURE(i);
      CAPTURE(static_cast<int>(order));
      const double angle = 1.3 * i;
      const Camera camera = look_at({0.1 * i, -0.2, 0.15 * i},
                                    {std::cos(angle), 0.3, std::sin(angle)}, {0, 1, 0}, 45, 39, 30);
      TraceOptions options;
      options.hit_order = order;
      check_against_reference(context, model, options, camera);
      options.packet_shape = PacketShape::kGroup;
      check_against_reference(context, model, options, camera);
    }
  }
}

TEST_CASE("what the camera plane cuts beside the picture is in no list, else it is seen") {
  Context context = make_test_context();
  Camera camera;  // sees x / z from -1 to 4
  camera.width = 100;
  camera.height = 40;
  camera.fx = camera.fy = 20;
  camera.cx = camera.cy = 20;
  Gaussians model = reference::random_scene(1, 9, 0);
  std::fill(model.log_scales.begin(), model.log_scales.end(), std::log(0.1f));
  for (const float x : {-1.5f, 1.0f}) {
    for (const Packet& packet : packets({1, 8}, {32})) {
      CAPTURE(x);
      CAPTURE(packet);
      model.means = {x, 0.0f, 0.0f};
      const TraceOptions options = packet.over({});
      const DeviceGaussians gaussians =
          DeviceGaussians::upload(context, model, ScaleActivation::kExp);
      CameraTracer tracer(context, options);
      tracer.update(gaussians);
      tracer.forward(gaussians, camera);
      CHECK((tracer.statistics().candidates > 0) == (x > 0));
      CHECK((tracer.statistics().hits > 0) == (x > 0));
      check_against_reference(context, model, options, camera);
    }
  }
}

TEST_CASE("near_depth skips what a rasteriser would clip") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 11, 0);
  TraceOptions options;
  options.near_depth = 4.2f;
  check_against_reference(context, model, options, reference::cube_camera(32, 32));
}

TEST_CASE("opaque, transparent and clipped Gaussians") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(300, 12, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 3 == 0) model.opacities[i] = 40.0f;
    if (i % 3 == 1) model.opacities[i] = -40.0f;
  }
  check_against_reference(context, model, {}, reference::cube_camera(40, 40));
}

TEST_CASE("needles and sheets of 1:10000") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(400, 13, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.log_scales[3 * i] = std::log(2.0f);
    model.log_scales[3 * i + 1] = std::log(2e-4f);
    model.log_scales[3 * i + 2] = i % 2 == 0 ? std::log(2e-4f) : std::log(2.0f);
  }
  const Camera camera = reference::cube_camera(40, 40);
  const Image image = trace_image(context, model, {}, camera);
  const Difference difference =
      compare(image, reference::render(reference::Parameters(model), {}, camera));
  // Read by scripts/figures.sh.
  MESSAGE("needles and sheets: ", difference.excused, " of ", difference.pixels,
          " pixels excused, mean ", difference.mean, ", maximum ", difference.maximum);
  CHECK(difference.mean < 1e-5);
  CHECK(difference.maximum < 1e-3);
}

TEST_CASE("parameters that are not finite never reach the image") {
  Context context = make_test_context();
  const float poison[] = {NAN, INFINITY, -INFINITY, 1e38f, -1e38f, 1e-40f, 0.0f};
  for (const float value : poison) {
    CAPTURE(value);
    Gaussians model = reference::random_scene(70, 14, 1);
    model.means[0] = value;
    model.quaternions[4 * 1] = value;
    for (std::size_t k = 0; k < 4; ++k) model.quaternions[4 * 2 + k] = value;
    model.log_scales[3 * 3] = value;
    model.opacities[4] = value;
    const Image image = trace_image(context, model, {}, reference::cube_camera(17, 17));
    for (const float pixel : image.data) CHECK(std::isfinite(pixel));
  }
}

TEST_CASE("bands of tile rows give the same image as the whole") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(2000, 15, 0);
  const Camera camera = reference::cube_camera(150, 140);
  TraceOptions options;
  const Image whole = trace_image(context, model, options, camera);
  options.memory_budget = 20000;
  const Image banded = trace_image(context, model, options, camera);
  CHECK(whole.data == banded.data);
}

TEST_CASE("tiles of a row whose lists are too long are traced apart") {
  Context context = make_test_context();
  // 1500 faint Gaussians over the whole of a picture of one row of tiles.
  Gaussians model = reference::random_scene(1500, 16, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) model.log_scales[3 * i + k] = std::log(0.8f);
    model.opacities[i] = -5.0f;
  }
  const Camera camera = reference::cube_camera(200, 20);
  TraceOptions options;
  options.max_hits = 10000;
  for (const Packet& packet : packets({1, 8, 16}, {32})) {
    CAPTURE(packet);
    options = packet.over(options);
    options.memory_budget = std::size_t{1} << 30;
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    CameraTracer whole(context, options);
    whole.update(gaussians);
    whole.forward(gaussians, camera);
    options.memory_budget = 1000;
    CameraTracer parts(context, options);
    parts.update(gaussians);
    parts.forward(gaussians, camera);
    CHECK(whole.download_image().data == parts.download_image().data);
    CHECK(whole.statistics().candidates == parts.statistics().candidates);
    CHECK(whole.statistics().hits == parts.statistics().hits);
  }
}

TEST_CASE("packets that are no subgroup are refused where subgroups are asked for [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(20, 18, 0);
  const Camera camera = reference::cube_camera(9, 7);
  TraceOptions options;
  options.packet_shape = PacketShape::kSubgroup;
  // 64 work-items are one subgroup on few devices.
  for (const int width : {8, 64}) {
    CAPTURE(width);
    options.packet_width = width;
    std::string refusal;
    try {
      check_against_reference(context, model, options, camera);
    } catch (const DeviceError& error) {
      refusal = error.what();
    }
    if (!context.device().has_subgroups) {
      CHECK(refusal.find("has no subgroups") != std::string::npos);
    } else if (!refusal.empty()) {
      CHECK(width == 64);
      CHECK(refusal.find("subgroups of a packet of 64 rays") != std::string::npos);
    }
  }
  // Without being asked for they are groups there.
  options.packet_shape = PacketShape::kAuto;
  options.packet_width = 64;
  check_against_reference(context, model, options, camera);
}

TEST_CASE("lists that 32 bits cannot count are refused before anything is written") {
  Context context = make_test_context();
  // Every Gaussian meets every tile of one pixel: 65800 x 65280 = 2^32 + 456704.
  constexpr std::size_t kCount = 65800;
  Gaussians model = reference::random_scene(kCount, 17, 0);
  for (std::size_t i = 0; i < kCount; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] = 0.0f;
      model.log_scales[3 * i + k] = 0.0f;
    }
  }
  Camera camera = reference::cube_camera(256, 255);
  camera.fx = camera.fy = 2000.0;
  const TraceOptions options;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Buffer<RsAabb> boxes(context, kCount, "boxes");
  const RsCamera converted = device_camera(camera, TraceOptions{});
  CandidateLists lists(context, 1);
  lists.prepare(gaussians, converted, {}, options);
  Buffer<std::uint32_t> counters(context, RS_COUNT_WORDS, "counters");
  counters.clear();
  CHECK_FALSE(lists.build(boxes, converted, {0, 0, 256, 255}, std::size_t{1} << 30, counters));
  CHECK(counters.read(RS_COUNT_CANDIDATES) == 0);
  REQUIRE(lists.build(boxes, converted, {200, 7, 3, 2}, std::size_t{1} << 30, counters));
  CHECK(counters.read(RS_COUNT_CANDIDATES) == 6 * kCount);
  Buffer<std::uint32_t> overflow(context, 1, "overflow");
  overflow.clear();
  const std::size_t budget = std::size_t{1} << 30;
  lists.build_ahead(boxes, converted, {0, 0, 256, 255}, budget, false, counters, overflow);
  CHECK(overflow.read(0) == 1);
  CHECK(counters.read(RS_COUNT_CANDIDATES + 1) == 1);  // added to those before
  overflow.clear();
  counters.fill(7);
  lists.build_ahead(boxes, converted, {200, 7, 3, 2}, budget, true, counters, overflow);
  CHECK(overflow.read(0) == 0);
  CHECK(counters.read(RS_COUNT_CANDIDATES) == 6 * kCount);
  CHECK(counters.read(RS_COUNT_CHUNKS) == 0);
}

TEST_CASE("lists with all the room that the largest buffer gives fit it, padding included") {
  DeviceInfo device = test_device();
  device.max_allocation = 1 << 20;  // boxes of 65536 candidates, 16 of them padding
  Context context(device);
  constexpr std::size_t kCount = 100;
  Gaussians model = reference::random_scene(kCount, 17, 0);
  for (std::size_t i = 0; i < 3 * kCount; ++i) model.means[i] = model.log_scales[i] = 0.0f;
  Camera camera = reference::cube_camera(30, 30);
  camera.fx = camera.fy = 200.0;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Buffer<RsAabb> boxes(context, kCount, "boxes");
  const RsCamera converted = device_camera(camera, TraceOptions{});
  CandidateLists lists(context, 1);
  lists.prepare(gaussians, converted, {}, TraceOptions{});
  Buffer<std::uint32_t> counters(context, RS_COUNT_WORDS, "counters");
  counters.clear();
  // Every Gaussian meets every tile of one pixel: 60000 of them, for which a quarter more would be
  // too much.
  REQUIRE(lists.build(boxes, converted, {0, 0, 30, 20}, std::size_t{1} << 30, counters));
  CHECK(counters.read(RS_COUNT_CANDIDATES) == 600 * kCount);
  CHECK_FALSE(lists.build(boxes, converted, {0, 0, 30, 22}, std::size_t{1} << 30, counters));
}

TEST_CASE("pictures as wide as can be are traced to their last pixel") {
  Context context = make_test_context();
  DeviceTuning tuning;
  tuning.packet_width = 4;
  tuning.tile = 16;
  context.set_tuning(tuning);
  Gaussians model = reference::random_scene(3, 18, 0);
  constexpr int kWidth = 1 << 20;
  Camera camera = reference::cube_camera(kWidth, 1);
  camera.fx = camera.fy = 2e5;
  // In the first, a middle and the last columns.
  for (std::size_t i = 0; i < model.size(); ++i) {
    const double pixel = std::array<double, 3>{40.0, 600000.0, kWidth - 40.0}[i];
    const glm::dvec3 seen{5.0 * (pixel - camera.cx) / camera.fx, 0.0, 5.0};
    const glm::dvec3 mean = camera.center() + glm::transpose(camera.rotation) * seen;
    for (int k = 0; k < 3; ++k) {
      model.means[3 * i + static_cast<std::size_t>(k)] = static_cast<float>(mean[k]);
      model.log_scales[3 * i + static_cast<std::size_t>(k)] = std::log(1e-3f);
    }
    model.opacities[i] = 4.0f;
  }
  const Image image = trace_image(context, model, {}, camera);
  for (const int pixel : {40, 600000, kWidth - 40}) {
    CAPTURE(pixel);
    CHECK(image.data[4 * static_cast<std::size_t>(pixel) + 3] > 0.5f);
  }
  for (const int pixel : {4000, 1000000, kWidth - 4000}) {
    CAPTURE(pixel);
    CHECK(image.data[4 * static_cast<std::size_t>(pixel) + 3] == 0.0f);
  }
}
