// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "trace/exact_sum.h"
#include "trace/gradient_sums.hpp"
#include "trace/launch_budget.hpp"
#include "unit/log_capture.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 90;
constexpr int kHeight = 70;

struct Pass {
  std::vector<float> image, means, quaternions, scales, opacities, sh, screen;
  bool operator==(const Pass&) const = default;
};

// One view forward and backward with its own tracer.
Pass trace_view(Context& context,
                const Gaussians& model,
                const TraceOptions& options,
                double unit = 1.0) {
  Camera camera = reference::cube_camera(kWidth, kHeight);
  camera.translation *= unit;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  const std::vector<float> values = random_image_gradient(kWidth * kHeight, 5);
  Buffer<float> gradient(context, values.size(), "image gradient");
  gradient.upload(values);
  GaussianGradients out;
  tracer.backward(gaussians, gradient, out);
  Pass first{tracer.image().download(), out.means.download(),     out.quaternions.download(),
             out.scales.download(),     out.opacities.download(), out.sh.download(),
             out.screen.download()};
  // Once more with the same buffers: nothing may be left in them.
  tracer.forward(gaussians, camera, true);
  tracer.backward(gaussians, gradient, out);
  const std::vector<float> again = out.means.download();
  if (options.gradient_sum != GradientSum::kAtomic)
    CHECK(std::memcmp(again.data(), first.means.data(), 4 * again.size()) == 0);
  return first;
}

double error(const Pass& a, const Pass& b) {
  const auto of = [](const std::vector<float>& x, const std::vector<float>& y) {
    return relative_error(x, std::vector<double>(y.begin(), y.end()));
  };
  return std::max({of(a.means, b.means), of(a.quaternions, b.quaternions), of(a.scales, b.scales),
                   of(a.opacities, b.opacities), of(a.sh, b.sh)});
}

// What cl/trace/exact_probe.cl makes of the values.
float exact_sum(Context& context, const std::vector<float>& values, float limit = 1e9f) {
  Buffer<float> input(context, values.size(), "values");
  input.upload(values);
  Buffer<std::uint32_t> words(context, 16 * RS_EXACT_WORDS, "exact sum");
  words.fill(RS_EXACT_BIAS);
  Buffer<float> line(context, 16, "line");
  const auto count = static_cast<std::uint32_t>(values.size());
  context.kernel("trace/exact_probe.cl", "add_exactly")
      .launch(Range::linear(values.size(), 1), count, input, limit, words);
  context.kernel("trace/gradient_sums.cl", "round_exact_lines")
      .launch(Range::linear(1, 1), 1u, words, line);
  for (const std::uint32_t word : words.download()) CHECK(word == RS_EXACT_BIAS);
  const std::vector<float> sums = line.download();
  for (std::size_t i = 1; i < sums.size(); ++i) CHECK(sums[i] == 0.0f);
  return sums[0];
}

}  // namespace

TEST_CASE("exact sums lose nothing between the largest and the smallest") {
  Context context = make_test_context();
  CHECK(exact_sum(context, {1.0f}) == 1.0f);
  CHECK(exact_sum(context, {-1.0f}) == -1.0f);
  CHECK(exact_sum(context, {0.0f, -0.0f}) == 0.0f);
  CHECK(exact_sum(context, {0x1p28f, 0x1p-100f, -0x1p28f}) == 0x1p-100f);
  CHECK(exact_sum(context, {0x1p28f, -0x1p-100f, -0x1p28f}) == -0x1p-100f);
  CHECK(exact_sum(context, {0x1p74f, -0x1p-100f, -0x1p74f}, 0x1p75f) == -0x1p-100f);
  CHECK(exact_sum(context, {-0x1p-110f, -0x1p-110f}) == -0x1p-109f);
  CHECK(exact_sum(context, {0x1p-111f, 0x1p-140f}) == 0.0f);  // cut off
  CHECK(exact_sum(context, {1.0f, 0x1.fffffep-30f}) == 1.0f + 0x1.fffffep-30f);
  // Every place of a mantissa, and carries through several words.
  for (int exponent = -86; exponent < 74; ++exponent) {
    const float value = std::ldexp(0x1.fffffep0f, exponent);
    CAPTURE(exponent);
    const auto sum = [&](const std::vector<float>& values) {
      return exact_sum(context, values, 0x1p75f);
    };
    CHECK(sum({value}) == value);
    CHECK(sum({-value, -value}) == -2.0f * value);
    CHECK(sum({value, value, -value}) == value);
    CHECK(sum({-value, 0x1p-86f, value}) == 0x1p-86f);
  }
}

TEST_CASE("exact sums of random values equal sums in integers, in any order") {
  Context context = make_test_context();
  CounterRng rng(3, 9);
  std::vector<float> values;
  std::int64_t expected = 0;  // in units of 2^-60
  for (int i = 0; i < 20000; ++i) {
    const auto mantissa = static_cast<std::int32_t>(rng.below(1u << 24)) - (1 << 23);
    const int place = static_cast<int>(rng.below(24));
    values.push_back(std::ldexp(static_cast<float>(mantissa), place - 60));
    expected += static_cast<std::int64_t>(mantissa) * (std::int64_t{1} << place);
  }
  const float sum = exact_sum(context, values);
  CHECK(sum == doctest::Approx(std::ldexp(static_cast<double>(expected), -60)).epsilon(1.2e-7));
  std::reverse(values.begin(), values.end());
  CHECK(exact_sum(context, values) == sum);
}

TEST_CASE("an addend that is not finite or beyond the limit makes an exact sum NaN") {
  Context context = make_test_context();
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  for (const float bad : {infinity, -infinity, nan, 1e9f, -1e9f}) {
    CAPTURE(bad);
    CHECK(std::isnan(exact_sum(context, {bad})));
    CHECK(std::isnan(exact_sum(context, {bad, -9e8f, -9e8f, -9e8f, bad, 9e8f, bad})));
  }
  CHECK(exact_sum(context, {9e8f, 1.0f}) == 9e8f);
}

TEST_CASE("the way of adding follows the device, and is never atomic where it must not be") {
  DeviceInfo cpu;
  cpu.type = DeviceType::kCpu;
  cpu.compute_units = 10;
  cpu.max_allocation = 1 << 20;
  DeviceInfo gpu = cpu;
  gpu.type = DeviceType::kGpu;
  DeviceInfo small = cpu;
  small.compute_units = 4;
  TraceOptions options;
  const auto choose = [&](const DeviceInfo& device, std::size_t lines, std::size_t room) {
    return GradientSumChoice::of(options, device, lines, room, 2);
  };
  CHECK(choose(cpu, 100, 1 << 20).sum == GradientSum::kCopies);
  CHECK(choose(cpu, 100, 1 << 20).copies == 20);
  CHECK(choose(cpu, 100, 13 * 6400).copies == 13);
  CHECK(!choose(cpu, 100, 1 << 20).crowded_out);
  CHECK(choose(gpu, 100, 1 << 20).sum == GradientSum::kAtomic);
  CHECK(choose(gpu, 100, 1 << 20).copies == 1);
  options.deterministic = true;
  CHECK(choose(cpu, 100, 1 << 20).sum == GradientSum::kCopies);
  CHECK(choose(gpu, 100, 1 << 20).sum == GradientSum::kExact);
  for (const GradientSum sum : {GradientSum::kAuto, GradientSum::kCopies}) {
    options.gradient_sum = sum;
    for (const bool deterministic : {false, true}) {
      options.deterministic = deterministic;
      CHECK(choose(cpu, 100, 9 * 6400).sum == GradientSum::kExact);
      CHECK(choose(cpu, 100, 9 * 6400).copies == 1);
      CHECK(choose(cpu, 100, 9 * 6400).crowded_out);
      CHECK(choose(cpu, 10000, 1 << 24).sum == GradientSum::kExact);  // the largest allocation
      // Exact sums of few compute units would take more than their copies.
      CHECK(choose(small, 100, 6400).sum == GradientSum::kCopies);
      CHECK(choose(small, 100, 6400).copies == 4);
      CHECK(!choose(small, 100, 6400).crowded_out);
      CHECK(choose(small, 10000, 6400).sum == GradientSum::kExact);
    }
  }
  options.gradient_sum = GradientSum::kCopies;
  CHECK(choose(gpu, 100, 1 << 20).copies == 20);
  options.gradient_sum = GradientSum::kAtomic;
  CHECK(choose(cpu, 100, 1 << 20).sum == GradientSum::kAtomic);
  options.gradient_sum = GradientSum::kExact;
  CHECK(choose(cpu, 100, 1 << 20).sum == GradientSum::kExact);
  CHECK(!choose(cpu, 100, 9 * 6400).crowded_out);
}

TEST_CASE("the log tells once that copies of gradients give way to exact sums") {
  Context context = make_test_context();
  GradientSums sums(context, "line gradients");
  const LogCapture log;
  sums.prepare({GradientSum::kExact, 1, false}, 3);
  CHECK(log.lines() == 0);
  for (int pass = 0; pass < 2; ++pass) {
    sums.prepare({GradientSum::kExact, 1, true}, 3);
    CHECK(log.lines() == 1);
    CHECK(log.contains("line gradients: a private copy"));
  }
}

// Some packets of the many Gaussians around one place are left to the second launch of a group.
TEST_CASE("every way of adding gradients gives the same, and all but atomics the same bits") {
  Context context = make_test_context();
  std::vector<std::pair<Packet, Gaussians>> cases;
  for (const Packet& packet : packets({1, 16}, {32}))
    cases.emplace_back(packet, reference::random_scene(1500, 31, 1));
  cases.emplace_back(Packet{PacketShape::kGroup, 32}, crowded_scene(60));
  for (const auto& given : cases) {
    const Packet packet = given.first;
    const Gaussians& model = given.second;
    CAPTURE(packet);
    CAPTURE(model.size());
    TraceOptions options = packet.over({});
    options.gradient_sum = GradientSum::kCopies;
    const Pass copies = trace_view(context, model, options);
    options.gradient_sum = GradientSum::kExact;
    const Pass exact = trace_view(context, model, options);
    options.gradient_sum = GradientSum::kAtomic;
    const Pass atomic = trace_view(context, model, options);
    CHECK(error(exact, copies) < 1e-5);
    CHECK(error(atomic, copies) < 1e-5);
    CHECK(exact.image == copies.image);

    for (const GradientSum sum : {GradientSum::kCopies, GradientSum::kExact}) {
      CAPTURE(static_cast<int>(sum));
      const Pass& base = sum == GradientSum::kExact ? exact : copies;
      TraceOptions variant = options;
      variant.gradient_sum = sum;
      CHECK(trace_view(context, model, variant) == base);
      // Bands of one row of tiles, or a few segments, each: no launch is this short.
      variant.launch_budget_ms = 1e-6;
      CHECK(trace_view(context, model, variant) == base);
      variant.launch_budget_ms = 1e6;
      CHECK(trace_view(context, model, variant) == base);
    }
    // Hits that are computed again in bands.
    TraceOptions tight = options;
    tight.gradient_sum = GradientSum::kExact;
    tight.memory_budget = 4500000;
    CHECK(trace_view(context, model, tight) == exact);
    tight.launch_budget_ms = 1e-6;
    CHECK(trace_view(context, model, tight) == exact);
  }
}

TEST_CASE("exact sums take the gradients of scenes in large and in small units") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 33, 0);
  for (const int power : {-20, 24}) {
    CAPTURE(power);
    Gaussians scaled = model;
    for (float& mean : scaled.means) mean = std::ldexp(mean, power);
    for (float& scale : scaled.log_scales) scale += static_cast<float>(power * std::log(2.0));
    TraceOptions options;
    options.gradient_sum = GradientSum::kExact;
    const Pass exact = trace_view(context, scaled, options, std::ldexp(1.0, power));
    options.gradient_sum = GradientSum::kCopies;
    const Pass copies = trace_view(context, scaled, options, std::ldexp(1.0, power));
    for (const auto* values : {&exact.means, &exact.quaternions, &exact.scales, &exact.opacities}) {
      CHECK(std::all_of(values->begin(), values->end(), [](float v) { return std::isfinite(v); }));
    }
    CHECK(error(exact, copies) < 1e-5);
  }
}

TEST_CASE("gradients beyond the range of exact sums are refused, the others are not touched") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(40, 32, 0);
  model.sh[0] = 1e30f;
  TraceOptions options;
  options.gradient_sum = GradientSum::kExact;
  const Pass exact = trace_view(context, model, options);
  options.gradient_sum = GradientSum::kCopies;
  const Pass copies = trace_view(context, model, options);
  std::size_t refused = 0;
  for (std::size_t i = 0; i < model.opacities.size(); ++i) {
    CAPTURE(i);
    if (std::abs(copies.opacities[i]) < 1e6f) {
      CHECK(exact.opacities[i] == doctest::Approx(copies.opacities[i]).epsilon(1e-4));
    } else {
      CHECK(std::isnan(exact.opacities[i]));
      ++refused;
    }
  }
  CHECK(refused > 5);
  CHECK(refused < 35);
}

TEST_CASE("a budget of time sizes launches by what they took") {
  LaunchBudget off(0, DeviceType::kGpu);
  CHECK(!off.bounded());
  CHECK(off.rows(50) == 50);
  CHECK(!LaunchBudget(-1, DeviceType::kCpu).bounded());
  CHECK(LaunchBudget(-1, DeviceType::kGpu).bounded());

  CHECK(LaunchBudget(100, DeviceType::kCpu, 500).rows(5000) == 500);

  LaunchBudget budget(100, DeviceType::kCpu);
  CHECK(budget.rows(2) == 2);
  CHECK(budget.rows(50) == 4);
  budget.record(4, 0.010);  // 40 would fit, but it grows by steps of four
  CHECK(budget.rows(50) == 16);
  budget.record(16, 0.040);
  CHECK(budget.rows(50) == 40);
  CHECK(budget.rows(10) == 10);
  budget.record(10, 0.025);  // the end of an image says nothing against 40
  CHECK(budget.rows(50) == 40);
  budget.record(40, 1.0);
  CHECK(budget.rows(50) == 4);
  budget.record(4, 10.0);
  CHECK(budget.rows(50) == 1);
  budget.record(1, 10.0);
  CHECK(budget.rows(50) == 1);
  for (int i = 0; i < 20; ++i) budget.record(budget.rows(50), 0.0);
  CHECK(budget.rows(50) == 50);
}
