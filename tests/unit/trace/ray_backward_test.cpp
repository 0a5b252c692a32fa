// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_backward.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <glm/matrix.hpp>

#include "raysplats/error.hpp"
#include "trace/gradient_sums.hpp"
#include "unit/bvh/tree_forms.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

using Gradients = std::vector<RayBackward::ResultGradient>;

Gradients random_gradients(std::size_t count, std::uint64_t seed) {
  CounterRng rng(seed, 78);
  Gradients out(count);
  for (RayBackward::ResultGradient& g : out) {
    for (float& value : g) value = static_cast<float>(rng.normal());
  }
  return out;
}

reference::RayQuery query_of(const Ray& ray) {
  return {{ray.origin[0], ray.origin[1], ray.origin[2]},
          {ray.direction[0], ray.direction[1], ray.direction[2]},
          ray.t_min,
          ray.t_max};
}

reference::ColorMode mode_of(ColorDirection direction) {
  return direction == ColorDirection::kRay ? reference::ColorMode::kAlongRay
                                           : reference::ColorMode::kFromOrigin;
}

// One traced batch on the device with its gradients.
struct Batch {
  Batch(Context& context, const std::vector<Ray>& host_rays, const Gradients& host_gradients)
      : rays(context, host_rays.size(), "rays"),
        gradients(context, host_rays.size(), "ray gradients") {
    rays.upload(host_rays);
    gradients.upload(host_gradients);
  }
  Buffer<Ray> rays;
  Buffer<RayBackward::ResultGradient> gradients;
  Buffer<RayResult> results;
};

HostGradients gradients_on_device(Context& context,
                                  const DeviceGaussians& gaussians,
                                  const TraceOptions& options,
                                  const std::vector<Ray>& rays,
                                  const Gradients& gradients,
                                  ColorDirection direction,
                                  const TreeForm& form = tree_form(test_device())) {
  RayTracer tracer(context, options, form);
  tracer.update(gaussians);
  Batch batch(context, rays, gradients);
  tracer.trace(gaussians, batch.rays, rays.size(), batch.results, direction);
  RayBackward backward(context, tracer);
  backward.begin(gaussians);
  backward.add(gaussians, batch.rays, rays.size(), batch.results, batch.gradients, direction);
  GaussianGradients out;
  backward.finish(gaussians, out);
  return HostGradients(out);
}

// Random gradients, zero where single precision may order or cut hits otherwise than double.
Gradients gradients_without_ties(const reference::Parameters& parameters,
                                 const TraceOptions& options,
                                 const std::vector<Ray>& rays,
                                 ColorDirection direction) {
  Gradients gradients = random_gradients(rays.size(), 3);
  const auto prepared = reference::prepare(parameters, options);
  std::size_t hits = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const reference::RayQuery q = query_of(rays[i]);
    const reference::RayTrace ray = reference::trace_ray(
        parameters, prepared, options, q.origin, q.direction, q.t_min, q.t_max, mode_of(direction));
    hits += ray.hits.size();
    if (ray.margin < 1e-4) gradients[i] = {};
  }
  CHECK(2 * hits > rays.size());
  return gradients;
}

GradientErrors compare_gradients(Context& context,
                                 const Gaussians& model,
                                 const TraceOptions& options,
                                 const std::vector<Ray>& rays,
                                 ColorDirection direction,
                                 ScaleActivation activation = ScaleActivation::kExp,
                                 const TreeForm& form = tree_form(test_device())) {
  const reference::Parameters parameters(model, activation);
  const Gradients gradients = gradients_without_ties(parameters, options, rays, direction);
  std::vector<reference::RayQuery> queries;
  std::vector<double> wide;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    queries.push_back(query_of(rays[i]));
    wide.insert(wide.end(), gradients[i].begin(), gradients[i].end());
  }
  const reference::Parameters expected =
      reference::ray_gradient(parameters, options, queries, wide, mode_of(direction));
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
  return errors_of(
      gradients_on_device(context, gaussians, options, rays, gradients, direction, form), expected);
}

void check_every_variant(Gaussians model, const std::vector<Ray>& rays) {
  Context context = make_test_context();
  // Sigmoid scales stay below 1.
  for (float& scale : model.log_scales) scale = std::min(scale, -0.2f);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
      for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
        CAPTURE(static_cast<int>(order));
        CAPTURE(static_cast<int>(direction));
        CAPTURE(static_cast<int>(activation));
        TraceOptions options;
        options.hit_order = order;
        options.adaptive_radius = activation == ScaleActivation::kSigmoid;
        options.background = {0.25f, 0.5f, 1.0f};
        CHECK_ERRORS(compare_gradients(context, model, options, rays, direction, activation), 1e-3);
      }
    }
  }
}

}  // namespace

TEST_CASE("gradients of arbitrary rays equal the double reference in every variant") {
  check_every_variant(reference::random_scene(300, 71, 2), random_rays(300, 21));
}

TEST_CASE("gradients of a few arbitrary rays equal the double reference [small]") {
  check_every_variant(reference::random_scene(24, 72, 1), random_rays(30, 22));
}

TEST_CASE("what raises a clamped colour passes to rays where it is asked for [small]") {
  Context context = make_test_context();
  Gaussians dark = reference::random_scene(60, 74, 0);
  for (std::size_t i = 0; i < dark.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) dark.sh[3 * i + k] = i % 2 == 0 ? -2.5f : 0.5f;
  }
  const std::vector<Ray> rays = random_rays(100, 25);
  double moved[2] = {};
  for (const bool raises : {false, true}) {
    CAPTURE(raises);
    TraceOptions options;
    options.raise_clamped = raises;
    CHECK_ERRORS(compare_gradients(context, dark, options, rays, ColorDirection::kRay), 1e-3);
    const Gradients wish(rays.size(), {-1.0f, -1.0f, -1.0f, -1.0f});
    const HostGradients found =
        gradients_on_device(context, DeviceGaussians::upload(context, dark, ScaleActivation::kExp),
                            options, rays, wish, ColorDirection::kRay);
    for (std::size_t i = 0; i < dark.size(); i += 2)
      moved[raises] += std::abs(static_cast<double>(found.sh[3 * i]));
  }
  CHECK(moved[0] == 0.0);
  CHECK(moved[1] > 0.0);
}

TEST_CASE("gradients of arbitrary rays for every SH degree and vector width") {
  Context context = make_test_context();
  for (int degree = 0; degree <= 4; ++degree) {
    for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
      CAPTURE(degree);
      CAPTURE(static_cast<int>(direction));
      CHECK_ERRORS(compare_gradients(context, reference::random_scene(203, 73, degree), {},
                                     random_rays(300, 23), direction),
                   1e-3);
    }
  }
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    CHECK_ERRORS(
        compare_gradients(context, reference::random_scene(203, 73, 1), {}, random_rays(300, 23),
                          ColorDirection::kRay, ScaleActivation::kExp, form),
        1e-3);
  }
}

TEST_CASE("gradients of arbitrary rays where Gaussians are opaque, vanish or are thin") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(250, 74, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (i % 3 == 0) model.opacities[i] = 40.0f;  // the sigmoid is exactly 1 in float
    if (i % 3 == 1) model.opacities[i] = -12.0f;
  }
  CHECK_ERRORS(compare_gradients(context, model, {}, random_rays(400, 24), ColorDirection::kRay),
               1e-3);
  for (const float logit : {12.0f, 16.118f, 20.0f}) {
    CAPTURE(logit);
    Gaussians nearly = reference::random_scene(60, 74, 0);
    std::fill(nearly.opacities.begin(), nearly.opacities.end(), logit);
    CHECK_ERRORS(compare_gradients(context, nearly, {}, random_rays(400, 24), ColorDirection::kRay),
                 1e-3);
  }
  // Discs a thousand times wider than thick.
  Gaussians discs = reference::random_scene(250, 75, 0);
  for (std::size_t i = 0; i < discs.size(); ++i) discs.log_scales[3 * i + i % 3] -= 7.0f;
  CHECK_ERRORS(compare_gradients(context, discs, {}, random_rays(400, 25), ColorDirection::kRay),
               1e-3);
  // A ray through the middle of an opaque Gaussian: alpha is exactly 1.
  for (std::size_t k = 0; k < 3; ++k) model.means[k] = 0.0f;
  Ray ray{{0.0f, 0.0f, -4.0f}, 0.0f, {0.0f, 0.0f, 1.0f}, kFar};
  TraceOptions options;
  options.background = {0.5f, 0.25f, 1.0f};
  CHECK_ERRORS(
      compare_gradients(context, model, options, std::vector<Ray>(1, ray), ColorDirection::kRay),
      1e-3);
}

TEST_CASE("gradients of rays that stop early, at the cap on hits, or have more hits than room") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 76, 1);
  for (const int cap : {1, 5, 9}) {
    CAPTURE(cap);
    TraceOptions options;
    options.max_hits = cap;
    options.background = {0.1f, 0.7f, 0.2f};
    CHECK_ERRORS(compare_gradients(context, model, options, random_rays(300, 26),
                                   ColorDirection::kFromOrigin),
                 1e-3);
  }
  for (const float stop : {0.5f, 0.05f, 0.0f}) {
    CAPTURE(stop);
    TraceOptions options;
    options.min_transmittance = stop;
    CHECK_ERRORS(
        compare_gradients(context, model, options, random_rays(300, 27), ColorDirection::kRay),
        1e-3);
  }
  // Hundreds of faint, wide ones along every ray.
  Gaussians crowd = reference::random_scene(900, 77, 0);
  for (std::size_t i = 0; i < crowd.log_scales.size(); ++i) {
    crowd.log_scales[i] = std::log(0.6f + 0.1f * static_cast<float>(i % 3));
  }
  for (float& opacity : crowd.opacities) opacity = -5.0f;
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  options.max_hits = 800;
  options.background = {0.1f, 0.7f, 0.2f};
  const reference::Parameters parameters(crowd);
  const reference::RayTrace middle = reference::trace_ray(
      parameters, options, {-3, 0.1, 0.2}, {1, 0, 0}, 0, 1e30, reference::ColorMode::kAlongRay);
  CHECK(middle.hits.size() > 600);
  std::vector<Ray> rays = random_rays(60, 28, 3.0);
  for (Ray& ray : rays) ray.t_max = kFar;
  // Among so many hits some are always near ties, each of little weight: no ray is left out.
  Gradients gradients = random_gradients(rays.size(), 4);
  std::vector<reference::RayQuery> queries;
  std::vector<double> wide;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    queries.push_back(query_of(rays[i]));
    wide.insert(wide.end(), gradients[i].begin(), gradients[i].end());
  }
  const reference::Parameters expected =
      reference::ray_gradient(parameters, options, queries, wide, reference::ColorMode::kAlongRay);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, crowd, ScaleActivation::kExp);
  CHECK_ERRORS(errors_of(gradients_on_device(context, gaussians, options, rays, gradients,
                                             ColorDirection::kRay),
                         expected),
               1e-3);
}

TEST_CASE("the gradients of camera rays are those of the camera tracer") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(1500, 78, 2);
  const Camera camera = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 60, 52, 80);
  TraceOptions options;
  options.background = {0.3f, 0.2f, 0.1f};
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  std::vector<Ray> rays;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const glm::dvec3 d =
          glm::transpose(camera.rotation) * reference::pixel_direction(camera, x, y);
      rays.push_back(make_ray(camera.center(), d));
    }
  }
  const Gradients gradients = gradients_without_ties(reference::Parameters(model), options, rays,
                                                     ColorDirection::kFromOrigin);
  const std::size_t pixels = rays.size();
  std::vector<float> planar(4 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 4; ++c) planar[c * pixels + i] = gradients[i][c];
  }
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  Buffer<float> image_gradient(context, planar.size(), "image gradient");
  image_gradient.upload(planar);
  GaussianGradients out;
  tracer.backward(gaussians, image_gradient, out);
  const HostGradients expected(out);

  RayTracer ray_tracer(context, options);
  ray_tracer.update(gaussians);
  Batch batch(context, rays, gradients);
  ray_tracer.trace(gaussians, batch.rays, pixels, batch.results, ColorDirection::kFromOrigin);
  RayBackward backward(context, ray_tracer);
  backward.begin(gaussians, RayScreen::of(camera));
  backward.add(gaussians, batch.rays, pixels, batch.results, batch.gradients,
               ColorDirection::kFromOrigin);
  backward.finish(gaussians, out);
  const HostGradients got(out);
  CHECK_ERRORS(errors_of(got, expected), 1e-3);
  // What the camera tracer leaves out of the mean's screen gradient, the change of the outline's
  // shape, is of the order of size over distance.
  check_screen(got, expected, 0.05, 0.05);
}

TEST_CASE("several batches of rays add up, and a new begin starts from zero") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(500, 79, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Ray> rays = random_rays(9000, 29);  // enough to be ordered
  const Gradients gradients = random_gradients(rays.size(), 5);
  const HostGradients whole =
      gradients_on_device(context, gaussians, {}, rays, gradients, ColorDirection::kRay);
  RayTracer tracer(context, {});
  tracer.update(gaussians);
  RayBackward backward(context, tracer);
  GaussianGradients out;
  CHECK_THROWS_AS(backward.finish(gaussians, out), UsageError);
  for (int pass = 0; pass < 2; ++pass) {
    backward.begin(gaussians);
    for (std::size_t begin = 0; begin < rays.size(); begin += 3000) {
      const auto from = static_cast<std::ptrdiff_t>(begin);
      Batch batch(context, {rays.begin() + from, rays.begin() + from + 3000},
                  {gradients.begin() + from, gradients.begin() + from + 3000});
      tracer.trace(gaussians, batch.rays, 3000, batch.results);
      CHECK_THROWS_AS(backward.add(gaussians, batch.rays, 3001, batch.results, batch.gradients,
                                   ColorDirection::kRay),
                      UsageError);
      backward.add(gaussians, batch.rays, 3000, batch.results, batch.gradients,
                   ColorDirection::kRay);
    }
    backward.finish(gaussians, out);
    CHECK_ERRORS(errors_of(HostGradients(out), whole), 1e-5);
  }
  // Abandoned sums do not reach the next gradients.
  Batch batch(context, rays, gradients);
  tracer.trace(gaussians, batch.rays, rays.size(), batch.results);
  for (int pass = 0; pass < 2; ++pass) {
    backward.begin(gaussians);
    backward.add(gaussians, batch.rays, rays.size(), batch.results, batch.gradients,
                 ColorDirection::kRay);
  }
  backward.finish(gaussians, out);
  CHECK_ERRORS(errors_of(HostGradients(out), whole), 1e-5);
}

TEST_CASE("every way of adding the gradients of rays equals the double reference") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 83, 2);
  for (const GradientSum sum :
       {GradientSum::kCopies, GradientSum::kExact, GradientSum::kAtomic, GradientSum::kSwap}) {
    for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
      CAPTURE(static_cast<int>(sum));
      CAPTURE(static_cast<int>(direction));
      TraceOptions options;
      options.gradient_sum = sum;
      CHECK_ERRORS(compare_gradients(context, model, options, random_rays(300, 32), direction),
                   1e-3);
    }
  }
}

TEST_CASE("a few gradients of rays in shared sums equal the double reference [small] [tiny]") {
  Context context = make_test_context();
  TraceOptions options;
  for (const GradientSum sum : {GradientSum::kExact, GradientSum::kAtomic, GradientSum::kSwap}) {
    CAPTURE(static_cast<int>(sum));
    options.gradient_sum = sum;
    CHECK_ERRORS(compare_gradients(context, reference::random_scene(12, 84, 1), options,
                                   random_rays(12, 33), ColorDirection::kFromOrigin),
                 1e-3);
  }
}

TEST_CASE("gradients of rays are the same to the bit but for atomics, exact ones in any order") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(3000, 80, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  std::vector<Ray> rays = random_rays(5000, 30);
  Gradients gradients = random_gradients(rays.size(), 6);
  TraceOptions options;
  const auto run = [&] {
    return gradients_on_device(context, gaussians, options, rays, gradients, ColorDirection::kRay);
  };
  options.gradient_sum = GradientSum::kCopies;
  const HostGradients copies = run();
  CHECK(run() == copies);
  options.gradient_sum = GradientSum::kAtomic;
  CHECK_ERRORS(errors_of(run(), copies), 1e-5);
  options.gradient_sum = GradientSum::kExact;
  const HostGradients exact = run();
  CHECK_ERRORS(errors_of(exact, copies), 1e-5);
  CHECK(run() == exact);
  // Copies that do not fit give way to exact sums, or, where these would take more, become fewer.
  options.gradient_sum = GradientSum::kCopies;
  options.memory_budget = 100000;
  if (context.device().compute_units > GradientSumChoice::kExactCopies) CHECK(run() == exact);
  CHECK_ERRORS(errors_of(run(), copies), 1e-5);
  // Batches, too small to be ordered, added by one object that is used again.
  options.gradient_sum = GradientSum::kExact;
  RayTracer tracer(context, options);
  tracer.update(gaussians);
  RayBackward backward(context, tracer);
  for (const std::size_t size : {std::size_t{5000}, std::size_t{1700}, std::size_t{333}}) {
    CAPTURE(size);
    backward.begin(gaussians);
    for (std::size_t begin = 0; begin < rays.size(); begin += size) {
      const auto from = static_cast<std::ptrdiff_t>(begin);
      const auto to = static_cast<std::ptrdiff_t>(std::min(begin + size, rays.size()));
      Batch batch(context, {rays.begin() + from, rays.begin() + to},
                  {gradients.begin() + from, gradients.begin() + to});
      const auto count = static_cast<std::size_t>(to - from);
      tracer.trace(gaussians, batch.rays, count, batch.results);
      backward.add(gaussians, batch.rays, count, batch.results, batch.gradients,
                   ColorDirection::kRay);
    }
    GaussianGradients out;
    backward.finish(gaussians, out);
    CHECK(HostGradients(out) == exact);
  }
  // Nor does it matter in which order they come.
  std::reverse(rays.begin(), rays.end());
  std::reverse(gradients.begin(), gradients.end());
  CHECK(run() == exact);
}

TEST_CASE("launches of rays keep to a budget of time and give the same bits") {
  ContextOptions watched;
  watched.profile = watched.keep_launches = true;
  Context context(test_device(), watched);
  const Gaussians model = reference::random_scene(500, 82, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Ray> rays = random_rays(6000, 32);
  const Gradients gradients = random_gradients(rays.size(), 7);
  const auto launches_of = [&](const char* kernel, const std::vector<LaunchTime>& launches) {
    return std::count_if(launches.begin(), launches.end(),
                         [&](const LaunchTime& launch) { return launch.kernel == kernel; });
  };
  for (const GradientSum sum : {GradientSum::kCopies, GradientSum::kExact}) {
    CAPTURE(static_cast<int>(sum));
    TraceOptions options;
    options.gradient_sum = sum;
    const auto run = [&](double milliseconds) {
      options.launch_budget_ms = milliseconds;
      return gradients_on_device(context, gaussians, options, rays, gradients,
                                 ColorDirection::kFromOrigin);
    };
    const HostGradients whole = run(0);
    std::vector<LaunchTime> launches = context.take_launches();
    CHECK(launches_of("trace_rays", launches) == 1);
    CHECK(launches_of("ray_backward", launches) == 1);
    // No launch is this short: each does the least there is.
    CHECK(run(1e-6) == whole);
    launches = context.take_launches();
    CHECK(launches_of("trace_rays", launches) > 20);
    CHECK(launches_of("ray_backward", launches) > 5);
    CHECK(run(1e6) == whole);
    context.take_launches();
  }
}

TEST_CASE("gradients of rays beyond the range of exact sums are refused, others are not touched") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(60, 85, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Ray> rays = random_rays(40, 34);
  Gradients gradients = random_gradients(rays.size(), 8);
  TraceOptions options;
  options.gradient_sum = GradientSum::kExact;
  const auto opacities = [&] {
    return gradients_on_device(context, gaussians, options, rays, gradients, ColorDirection::kRay)
        .opacities;
  };
  const std::vector<float> before = opacities();
  gradients[1] = {0, 0, 0, 1e30f};
  const std::vector<float> after = opacities();
  std::size_t refused = 0, kept = 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    refused += std::isnan(after[i]) ? 1 : 0;
    kept += before[i] != 0.0f && after[i] == before[i] ? 1 : 0;
    CHECK(std::isfinite(before[i]));
  }
  CHECK(refused > 0);
  CHECK(kept > 10);

  RayTracer tracer(context, options);
  tracer.update(gaussians);
  Batch batch(context, rays, gradients);
  tracer.trace(gaussians, batch.rays, 40, batch.results);
  RayBackward backward(context, tracer);
  const auto add = [&](std::size_t count) {
    backward.add(gaussians, batch.rays, count, batch.results, batch.gradients,
                 ColorDirection::kRay);
  };
  backward.begin(gaussians, {}, 60);
  add(40);
  CHECK_THROWS_AS(add(21), UsageError);
  add(20);
}

TEST_CASE("no Gaussians and no rays have no gradients") {
  Context context = make_test_context();
  const std::vector<Ray> rays = random_rays(3, 31);
  const DeviceGaussians none = DeviceGaussians::upload(context, Gaussians{}, ScaleActivation::kExp);
  CHECK(gradients_on_device(context, none, {}, rays, random_gradients(3, 7), ColorDirection::kRay)
            .means.empty());
  const DeviceGaussians some =
      DeviceGaussians::upload(context, reference::random_scene(20, 81, 1), ScaleActivation::kExp);
  RayTracer tracer(context, {});
  tracer.update(some);
  RayBackward backward(context, tracer);
  backward.begin(some);
  GaussianGradients out;
  backward.finish(some, out);
  for (const float value : out.means.download()) CHECK(value == 0.0f);
  for (const float value : out.screen.download()) CHECK(value == 0.0f);
}

TEST_CASE("no gradients are taken of rays that may be cones [tiny]") {
  Context context = make_test_context();
  TraceOptions options;
  options.view_footprint = 0.3f;
  RayTracer tracer(context, options);
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(3, 1, 0), ScaleActivation::kExp);
  tracer.update(gaussians);
  RayBackward backward(context, tracer);
  CHECK_THROWS_AS(backward.begin(gaussians), UsageError);
}
