// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "scene/image/pixel_count.hpp"
#include "skip_test.hpp"
#include "trace/gradient_sums.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

HostGradients gradients_on_device(Context& context,
                                  const Gaussians& model,
                                  const TraceOptions& options,
                                  const Camera& camera,
                                  ScaleActivation activation,
                                  const std::vector<float>& image_gradient) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  return backward(context, tracer, gaussians, image_gradient);
}

// The image gradient with zeros where single precision may order or cut hits otherwise than double.
std::vector<float> without_ties(std::vector<float> gradient, const reference::Render& render) {
  std::size_t kept = render.pixels();
  for (std::size_t i = 0; i < render.pixels(); ++i) {
    if (render.margin[i] >= 1e-4) continue;
    for (std::size_t c = 0; c < 4; ++c) gradient[c * render.pixels() + i] = 0.0f;
    --kept;
  }
  REQUIRE(4 * kept >= render.pixels());  // of ties alone nothing would be compared
  return gradient;
}

GradientErrors compare_gradients(Context& context,
                                 const Gaussians& model,
                                 const TraceOptions& options,
                                 const Camera& camera,
                                 ScaleActivation activation = ScaleActivation::kExp) {
  const reference::Parameters parameters(model, activation);
  const reference::Render render = reference::render(parameters, options, camera);
  const std::vector<float> image_gradient =
      without_ties(random_image_gradient(render.pixels(), 3), render);
  const std::vector<double> wide(image_gradient.begin(), image_gradient.end());
  const reference::Gradient expected =
      reference::render_gradient(parameters, options, camera, wide);
  const HostGradients got =
      gradients_on_device(context, model, options, camera, activation, image_gradient);
  return errors_of(got, expected.parameters);
}

/// Faint sheets one behind the other, which every ray of the cube's camera meets, and among them a
/// few Gaussians that lie near in some rays and far in others: streams of several segments, with
/// rows that reach into more than one. (Not many, and no sheets that cross: of hits that nearly tie
/// single precision need not find the order.) The more the sheets tilt, the more of them a packet
/// has open at once.
Gaussians layered_scene(std::size_t count, float tilt) {
  Gaussians out = reference::random_scene(count, 31, 1);
  std::fill(out.opacities.begin(), out.opacities.end(), 0.0f);
  for (std::size_t i = 0; i < count; ++i) {
    const bool oblique = i % 120 == 60;
    const std::array<float, 3> scales =
        oblique ? std::array{0.3f, 0.4f, 2.0f} : std::array{1.5f, 1.5f, 0.0005f};
    for (std::size_t k = 0; k < 3; ++k) {
      out.means[3 * i + k] *= oblique ? 0.3f : 0.0f;
      out.log_scales[3 * i + k] = std::log(scales[k]);
      out.quaternions[4 * i + k + 1] *= oblique ? 0.5f : 0.0f;
    }
    out.quaternions[4 * i] = 1.0f;
    if (oblique) continue;
    out.quaternions[4 * i + 2] = tilt;
    out.means[3 * i + 2] = 3.6f * static_cast<float>(i) / static_cast<float>(count) - 1.8f;
    out.opacities[i] = -5.0f;
  }
  return out;
}

// By how much the rays of pixels with a gradient blend more of each Gaussian than `least`, in sum.
std::vector<double> blended_beyond(const Gaussians& model,
                                   const TraceOptions& options,
                                   const Camera& camera,
                                   const std::vector<float>& image_gradient,
                                   double least) {
  const reference::Parameters parameters(model, ScaleActivation::kExp);
  const auto prepared = reference::prepare_view(parameters, options, camera);
  const std::size_t pixels = pixel_count(camera.width, camera.height);
  std::vector<double> out(model.size());
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    bool told = false;
    for (std::size_t c = 0; c < 4; ++c) told |= image_gradient[c * pixels + pixel] != 0;
    if (!told) continue;
    const int column = static_cast<int>(pixel) % camera.width;
    const int row = static_cast<int>(pixel) / camera.width;
    const glm::dvec3 direction =
        glm::transpose(camera.rotation) * reference::pixel_direction(camera, column, row);
    const reference::RayTrace ray = reference::trace_ray(
        parameters, prepared, options, camera.center(), direction, 0.0,
        std::numeric_limits<double>::infinity(), reference::ColorMode::kFromOrigin);
    for (const reference::Hit& hit : ray.hits)
      out[hit.index] += hit.transmittance * hit.alpha - least;
  }
  return out;
}

void check_every_variant(const Gaussians& model, const Camera& camera) {
  Context context = make_test_context();
  for_every_variant(
      model, [&](const Gaussians& bounded, TraceOptions options, ScaleActivation activation) {
        CHECK_ERRORS(compare_gradients(context, bounded, options, camera, activation), 1e-3);
        options.packet_shape = PacketShape::kGroup;
        CHECK_ERRORS(compare_gradients(context, bounded, options, camera, activation), 1e-3);
      });
}

}  // namespace

TEST_CASE("gradients equal the double reference in every variant") {
  check_every_variant(reference::random_scene(250, 21, 2), reference::cube_camera(21, 18));
}

TEST_CASE("gradients of a tiny scene equal the double reference in every variant [small]") {
  check_every_variant(reference::random_scene(24, 21, 1), reference::cube_camera(6, 5));
}

TEST_CASE("gradients of a few pixels equal the double reference in every way of adding [tiny]") {
  Context context = make_test_context();
  for (const Packet& packet : packets({1, 4}, {8, 32})) {
    for (const GradientSum sum :
         {GradientSum::kCopies, GradientSum::kExact, GradientSum::kAtomic, GradientSum::kSwap}) {
      CAPTURE(packet);
      CAPTURE(static_cast<int>(sum));
      TraceOptions options = packet.over({});
      options.gradient_sum = sum;
      // Two tiles have a copy each.
      const bool shared = sum != GradientSum::kCopies || packet.lanes != 8;
      CHECK_ERRORS(compare_gradients(context, reference::random_scene(8, 28, 1), options,
                                     reference::cube_camera(shared ? 5 : 20, 4)),
                   1e-3);
    }
  }
}

TEST_CASE("gradients of every SH degree, the direction's part included") {
  Context context = make_test_context();
  for (int degree = 0; degree <= 4; ++degree) {
    CAPTURE(degree);
    CHECK_ERRORS(compare_gradients(context, reference::random_scene(150, 22, degree), {},
                                   reference::cube_camera(25, 19)),
                 1e-3);
  }
}

TEST_CASE("what rays blend of each Gaussian equals the double reference [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(60, 26, 0);
  const Camera camera = reference::cube_camera(19, 17);
  for (const Packet& packet : packets({1, 4, 16}, {8, 32})) {
    for (const GradientSum sum :
         {GradientSum::kCopies, GradientSum::kExact, GradientSum::kAtomic}) {
      CAPTURE(packet);
      CAPTURE(static_cast<int>(sum));
      TraceOptions options = packet.over({});
      options.gradient_sum = sum;
      options.least_weight = 0.02f;
      const reference::Render render =
          reference::render(reference::Parameters(model, ScaleActivation::kExp), options, camera);
      const std::vector<float> image_gradient =
          without_ties(random_image_gradient(render.pixels(), 3), render);
      const HostGradients got = gradients_on_device(context, model, options, camera,
                                                    ScaleActivation::kExp, image_gradient);
      const std::vector<double> expected = blended_beyond(
          model, options, camera, image_gradient, static_cast<double>(options.least_weight));
      std::vector<float> blended;
      for (std::size_t i = 3; i < got.screen.size(); i += GaussianGradients::kScreenNumbers)
        blended.push_back(got.screen[i]);
      CHECK(relative_error(blended, expected) < 1e-4);
      CHECK(std::ranges::any_of(expected, [](double value) { return value > 0; }));
      CHECK(std::ranges::any_of(expected, [](double value) { return value < 0; }));
    }
  }
}

TEST_CASE("what raises a clamped colour passes where it is asked for [small]") {
  Context context = make_test_context();
  Gaussians dark = reference::random_scene(60, 22, 0);
  for (std::size_t i = 0; i < dark.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) dark.sh[3 * i + k] = i % 2 == 0 ? -2.5f : 0.5f;
  }
  const Camera camera = reference::cube_camera(12, 10);
  double moved[2] = {};
  for (const bool raises : {false, true}) {
    CAPTURE(raises);
    TraceOptions options;
    options.raise_clamped = raises;
    CHECK_ERRORS(compare_gradients(context, dark, options, camera), 1e-3);
    const HostGradients found =
        gradients_on_device(context, dark, options, camera, ScaleActivation::kExp,
                            std::vector<float>(4 * pixel_count(camera), -1.0f));
    for (std::size_t i = 0; i < dark.size(); i += 2)
      moved[raises] += std::abs(static_cast<double>(found.sh[3 * i]));
  }
  CHECK(moved[0] == 0.0);
  CHECK(moved[1] > 0.0);
}

TEST_CASE("gradients of opaque and of vanishing Gaussians") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(200, 23, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 3 == 0) model.opacities[i] = 40.0f;  // the sigmoid is exactly 1 in float
    if (i % 3 == 1) model.opacities[i] = -12.0f;
  }
  const Camera camera = reference::cube_camera(30, 30);
  CHECK_ERRORS(compare_gradients(context, model, {}, camera), 2e-3);
  for (const Packet& packet : packets({1, 16}, {8, 32})) {
    // 0: rays end behind what is opaque, and nowhere else.
    for (const float stop : {1e-4f, 0.0f}) {
      CAPTURE(packet);
      CAPTURE(stop);
      TraceOptions options = packet.over({});
      options.min_transmittance = stop;
      CHECK_ERRORS(compare_gradients(context, model, options, camera), 2e-3);
    }
  }
}

TEST_CASE("the opacities of nearly opaque Gaussians have gradients") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(60, 23, 0);
  for (const float logit : {12.0f, 16.118f, 20.0f}) {
    CAPTURE(logit);
    std::fill(model.opacities.begin(), model.opacities.end(), logit);
    for (const Packet& packet : packets({1, 16}, {32})) {
      CAPTURE(packet);
      CHECK_ERRORS(
          compare_gradients(context, model, packet.over({}), reference::cube_camera(20, 18)), 1e-3);
    }
  }
}

TEST_CASE("gradients of packets that are sorted because rays reach the cap on hits") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 27, 1);
  for (const Packet& packet : packets({1, 16}, {64})) {
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      CAPTURE(packet);
      TraceOptions options = packet.over({});
      options.hit_order = order;
      options.max_hits = 9;
      CHECK_ERRORS(compare_gradients(context, model, options, reference::cube_camera(30, 26)),
                   1e-3);
    }
  }
}

TEST_CASE("gradients of packets with more rows open than either launch of a group keeps") {
  Context context = make_test_context();
  for (const std::size_t count : {20, 50, 150}) {
    CAPTURE(count);
    const Gaussians model = crowded_scene(count);
    TraceOptions options;
    options.min_transmittance = 1e-6f;
    for (const Packet& packet : packets({16}, {8, 32, 64})) {
      for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
        if (order == HitOrder::kPeak && packet.lanes != 32) continue;
        CAPTURE(packet);
        options.hit_order = order;
        CHECK_ERRORS(
            compare_gradients(context, model, packet.over(options), reference::cube_camera(12, 10)),
            1e-3);
      }
    }
  }
}

TEST_CASE("gradients of a few pixels with more rows open than a group's launches keep [tiny]") {
  Context context = make_test_context();
  TraceOptions options;
  options.packet_shape = PacketShape::kGroup;
  options.packet_width = 8;
  for (const std::size_t count : {44, 80}) {
    CAPTURE(count);
    CHECK_ERRORS(
        compare_gradients(context, crowded_scene(count), options, reference::cube_camera(4, 2)),
        1e-3);
  }
}

TEST_CASE("gradients of packets whose hits run backward in segments") {
  Context context = make_test_context();
  const Gaussians model = layered_scene(600, 0.0f);
  const Camera camera = reference::cube_camera(12, 10);
  TraceOptions options;
  options.min_transmittance = 1e-6f;
  options.max_hits = 1024;
  const std::vector<float> image_gradient = random_image_gradient(pixel_count(camera), 9);
  for (const Packet& packet : packets({}, {8, 32, 64})) {
    CAPTURE(packet);
    for (const GradientSum sum : {GradientSum::kExact, GradientSum::kAtomic}) {
      if (sum == GradientSum::kAtomic && packet.lanes != 32) continue;
      CAPTURE(static_cast<int>(sum));
      TraceOptions variant = packet.over(options);
      variant.gradient_sum = sum;
      variant.hit_order = sum == GradientSum::kAtomic ? HitOrder::kEntry : HitOrder::kPeak;
      CHECK_ERRORS(compare_gradients(context, model, variant, camera), 1e-3);
      if (sum != GradientSum::kExact) continue;
      const auto gradients = [&] {
        return gradients_on_device(context, model, variant, camera, ScaleActivation::kExp,
                                   image_gradient);
      };
      const HostGradients once = gradients(), again = gradients();
      CHECK(once.means == again.means);
      CHECK(once.opacities == again.opacities);
      CHECK(once.scales == again.scales);
    }
  }
}

TEST_CASE("gradients of segments with more rows open than the first launch, and than both, keep") {
  Context context = make_test_context();
  TraceOptions options = Packet{PacketShape::kGroup, 32}.over({});
  options.gradient_sum = GradientSum::kExact;
  options.min_transmittance = 1e-6f;
  options.max_hits = 1024;
  for (const float tilt : {0.08f, 0.3f}) {
    CAPTURE(tilt);
    CHECK_ERRORS(compare_gradients(context, layered_scene(600, tilt), options,
                                   reference::cube_camera(12, 10)),
                 1e-3);
  }
}

TEST_CASE("gradients of a few pixels whose hits run backward in segments [small]") {
  Context context = make_test_context();
  TraceOptions options = Packet{PacketShape::kGroup, 8}.over({});
  options.min_transmittance = 1e-6f;
  for (const GradientSum sum : {GradientSum::kExact, GradientSum::kAtomic}) {
    CAPTURE(static_cast<int>(sum));
    options.gradient_sum = sum;
    CHECK_ERRORS(
        compare_gradients(context, layered_scene(300, 0.0f), options, reference::cube_camera(4, 2)),
        1e-3);
  }
}

TEST_CASE("gradients from a camera inside the scene") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 24, 1);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    TraceOptions options;
    options.hit_order = order;
    const Camera camera = look_at({0.1, -0.2, 0.15}, {1, 0.3, 0.5}, {0, 1, 0}, 41, 33, 28);
    CHECK_ERRORS(compare_gradients(context, model, options, camera), 2e-3);
  }
}

TEST_CASE("packet widths, every way of adding and recomputed hits give the same gradients") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(8000, 25, 1);
  const Camera camera = reference::cube_camera(70, 66);
  TraceOptions options;
  const std::vector<float> image_gradient = random_image_gradient(70 * 66, 5);
  options.packet_width = 16;
  const HostGradients base =
      gradients_on_device(context, model, options, camera, ScaleActivation::kExp, image_gradient);
  const auto check = [&](const TraceOptions& variant, const char* what) {
    CAPTURE(what);
    const HostGradients got =
        gradients_on_device(context, model, variant, camera, ScaleActivation::kExp, image_gradient);
    CHECK_ERRORS(errors_of(got, base), 1e-4);
  };
  for (const Packet& packet : packets({1, 2, 4, 8}, {8, 32, 64})) {
    CAPTURE(packet);
    check(packet.over(options), "packet");
  }
  TraceOptions tight = options;
  tight.memory_budget = 4200000;  // two private copies, hit lists in bands
  check(tight, "memory budget");
  tight.memory_budget = 1 << 18;
  check(tight, "less than the hits of a row of tiles");
  const auto sum_of = [&](const TraceOptions& variant) {
    return GradientSumChoice::of(variant, context.device(), model.size(), variant.memory_budget / 4,
                                 2)
        .sum;
  };
  tight.gradient_sum = GradientSum::kCopies;
  tight.memory_budget = 3900000;
  // Exact sums of few compute units would take more than their copies.
  if (context.device().compute_units > GradientSumChoice::kExactCopies)
    REQUIRE(sum_of(tight) == GradientSum::kExact);
  check(tight, "too little for private copies: exact sums, or fewer copies");
  tight.gradient_sum = GradientSum::kExact;
  check(tight, "exact sums, hit lists in bands");
  tight.gradient_sum = GradientSum::kAtomic;
  REQUIRE(sum_of(tight) == GradientSum::kAtomic);
  check(tight, "atomic adds, hit lists in bands");
  tight.memory_budget = options.memory_budget;
  check(tight, "atomic adds");
}

TEST_CASE("pose gradient equals the double reference") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(200, 26, 2);
  const Camera camera = look_at({0.5, -1.0, -3.5}, {0, 0, 0}, {0, 1, 0}, 30, 26, 40);
  const reference::Parameters parameters(model);
  const reference::Render render = reference::render(parameters, {}, camera);
  const std::vector<float> image_gradient =
      without_ties(random_image_gradient(render.pixels(), 6), render);
  const std::vector<double> wide(image_gradient.begin(), image_gradient.end());
  const reference::Gradient expected = reference::render_gradient(parameters, {}, camera, wide);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  CameraTracer tracer(context, {});
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  Buffer<float> gradient(context, image_gradient.size(), "image gradient");
  gradient.upload(image_gradient);
  GaussianGradients out;
  PoseGradient pose;
  tracer.backward(gaussians, gradient, out, &pose);
  for (int j = 0; j < 3; ++j) {
    const auto k = static_cast<std::size_t>(j);
    CHECK(pose.center[k] == doctest::Approx(expected.center[j]).epsilon(2e-3));
    CHECK(pose.rotation[k] == doctest::Approx(expected.rotation[j]).epsilon(2e-3));
  }
}

TEST_CASE("the backward pass gives the same bits every time on a CPU") {
  Context context = make_test_context();
  SKIP_TEST_UNLESS(context.device().type == DeviceType::kCpu, "the device is no CPU");
  const Gaussians model = reference::random_scene(1000, 27, 1);
  const Camera camera = reference::cube_camera(100, 90);
  const std::vector<float> image_gradient = random_image_gradient(9000, 7);
  const HostGradients a =
      gradients_on_device(context, model, {}, camera, ScaleActivation::kExp, image_gradient);
  const HostGradients b =
      gradients_on_device(context, model, {}, camera, ScaleActivation::kExp, image_gradient);
  CHECK(a.means == b.means);
  CHECK(a.quaternions == b.quaternions);
  CHECK(a.scales == b.scales);
  CHECK(a.sh == b.sh);
  CHECK(a.screen == b.screen);
}

TEST_CASE("a tracer used again for other views and other counts keeps no gradients of before") {
  Context context = make_test_context();
  CameraTracer tracer(context, {});
  GaussianGradients out;
  for (const std::size_t count : {300, 300, 90, 700, 90}) {
    CAPTURE(count);
    const Gaussians model = reference::random_scene(count, 28, 1);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    tracer.update(gaussians);
    for (const double side : {-3.5, 3.5, -3.0}) {
      const Camera camera = look_at({0.5, -1.0, side}, {0, 0, 0}, {0, 1, 0}, 70, 60, 80);
      const std::vector<float> image_gradient = random_image_gradient(70 * 60, 8);
      Buffer<float> gradient(context, image_gradient.size(), "image gradient");
      gradient.upload(image_gradient);
      tracer.forward(gaussians, camera, true);
      tracer.backward(gaussians, gradient, out);
      const HostGradients fresh =
          gradients_on_device(context, model, {}, camera, ScaleActivation::kExp, image_gradient);
      const auto error = [](const Buffer<float>& got, const std::vector<float>& expected) {
        return relative_error(got.download(),
                              std::vector<double>(expected.begin(), expected.end()));
      };
      CHECK(error(out.means, fresh.means) < 1e-5);
      CHECK(error(out.scales, fresh.scales) < 1e-5);
      CHECK(error(out.opacities, fresh.opacities) < 1e-5);
      CHECK(error(out.sh, fresh.sh) < 1e-5);
    }
  }
}
