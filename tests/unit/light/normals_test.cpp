// SPDX-License-Identifier: Apache-2.0
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <stdexcept>

#include "raysplats/error.hpp"
#include "raysplats/tracer.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

namespace {

/// The shortest axis of a Gaussian, turned against `away`.
glm::dvec3 reference_normal(const reference::Parameters& p, std::size_t i, const glm::dvec3& away) {
  std::array<double, 4> q;
  for (std::size_t k = 0; k < 4; ++k) q[k] = p.quaternions[4 * i + k];
  const glm::dmat3 axes = reference::rotation_matrix(q);
  int shortest = 0;
  for (int k = 1; k < 3; ++k) {
    if (p.scales[3 * i + static_cast<std::size_t>(k)] <
        p.scales[3 * i + static_cast<std::size_t>(shortest)])
      shortest = k;
  }
  const glm::dvec3 n = axes[shortest];
  return glm::dot(n, away) > 0.0 ? -n : n;
}

struct Expected {
  std::vector<double> normals;
  std::vector<double> margin;
};

/// Ray by ray and hit by hit, in double precision.
Expected expected_of(const Gaussians& model, const TraceOptions& options, const Camera& camera) {
  const reference::Parameters parameters(model);
  const auto prepared = reference::prepare_view(parameters, options, camera);
  const bool parallel = camera.model == CameraModel::kOrthographic;
  const glm::dvec3 axis = glm::transpose(camera.rotation)[2];
  Expected out;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
      glm::dvec3 sum(0.0);
      double margin = 1.0;
      const reference::RayTrace trace = reference::trace_ray(
          parameters, prepared, options, ray.origin, ray.direction, 0.0,
          std::numeric_limits<double>::infinity(), reference::ColorMode::kFromOrigin);
      for (const reference::Hit& hit : trace.hits) {
        const glm::dvec3 away = parallel ? axis : parameters.mean(hit.index) - camera.center();
        const glm::dvec3 n = reference_normal(parameters, hit.index, away);
        margin = std::min(margin, std::abs(glm::dot(n, glm::normalize(away))));
        sum += hit.transmittance * hit.alpha * n;
      }
      for (int k = 0; k < 3; ++k) out.normals.push_back(sum[k]);
      out.margin.push_back(std::min(margin, trace.margin));
    }
  }
  return out;
}

void check_normals(Context& context,
                   const Gaussians& gaussians,
                   const TraceOptions& options,
                   const Camera& camera) {
  const Expected expected = expected_of(gaussians, options, camera);
  const Model model(context, gaussians);
  Tracer tracer(context, options);
  const Image got = tracer.normals(model, camera);
  REQUIRE(got.channels == 3);
  REQUIRE(got.data.size() == expected.normals.size());
  std::size_t compared = 0;
  double size = 0;
  for (std::size_t i = 0; i < got.pixels(); ++i) {
    if (expected.margin[i] < 1e-4) continue;
    ++compared;
    for (std::size_t k = 0; k < 3; ++k) {
      const double wanted = expected.normals[3 * i + k];
      size = std::max(size, std::abs(wanted));
      CHECK(std::abs(static_cast<double>(got.data[3 * i + k]) - wanted) < 5e-4);
    }
  }
  CHECK(compared * 5 > 4 * got.pixels());
  CHECK(size > 0.3);
}

}  // namespace

TEST_CASE("normals equal those of a double reference, in packets and ray by ray [small]") {
  Context context = make_test_context();
  const Gaussians gaussians = reference::random_scene(60, 5, 2);
  const Camera camera = reference::cube_camera(24, 20);
  TraceOptions options;
  options.background = {0.7f, 0.2f, 0.4f};  // has no part in them
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      options.traversal = traversal;
      options.hit_order = order;
      check_normals(context, gaussians, options, camera);
    }
  }
}

TEST_CASE("normals through lenses and without a centre, with a near limit and adaptive radius") {
  Context context = make_test_context();
  const Gaussians gaussians = reference::random_scene(60, 6, 0);
  check_normals(context, gaussians, {}, fisheye_camera(24, 20));
  check_normals(context, gaussians, {}, view_of(CameraModel::kOrthographic, 24, 20, 9.0));
  TraceOptions options;
  options.adaptive_radius = true;
  options.near_depth = 2.0f;
  check_normals(context, gaussians, options, reference::cube_camera(24, 20));
}

TEST_CASE("normals follow the model and leave the last picture alone") {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(16, 12);
  const Model first(context, reference::random_scene(40, 7, 1));
  const Model second(context, reference::random_scene(30, 8, 1));
  Tracer tracer(context, {});
  const Image picture = tracer.render(first, camera, true);
  const Image gradient(16, 12, 4, 1.0f);
  const Image one = tracer.normals(first, camera);
  CHECK(tracer.backward(first, gradient).parameters.means.size() == 120);
  const Image two = tracer.normals(second, camera);
  CHECK(one.data != two.data);
  CHECK(tracer.normals(first, camera).data == one.data);
  CHECK(tracer.normals(first, camera, [](double) { return true; }).data == one.data);
}

TEST_CASE("normals follow the camera, in packets and ray by ray [small]") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(40, 7, 1));
  const Camera front = reference::cube_camera(16, 12);
  const Camera side = look_at({4, 0, 0.5}, {0, 0, 0.5}, {0, -1, 0}, 16, 12, 16.0);
  for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
    TraceOptions options;
    options.traversal = traversal;
    Tracer tracer(context, options), fresh(context, options);
    tracer.normals(model, front);
    CHECK(tracer.normals(model, side).data == fresh.normals(model, side).data);
  }
}

TEST_CASE("what a watch of normals throws comes out, and the last picture stays [small]") {
  Context context = make_test_context();
  const Camera camera = reference::cube_camera(16, 12);
  const Model model(context, reference::random_scene(40, 7, 1));
  Tracer tracer(context);
  const Image expected = tracer.normals(model, camera);
  tracer.render(model, camera, true);
  int calls = 0;
  CHECK_THROWS_AS(tracer.normals(model, camera,
                                 [&](double) -> bool {
                                   ++calls;
                                   throw std::out_of_range("of the watch");
                                 }),
                  std::out_of_range);
  CHECK(calls == 1);
  CHECK_NOTHROW(tracer.backward(model, Image(16, 12, 4, 1.0f)));
  CHECK(tracer.normals(model, camera).data == expected.data);
  CHECK(calls == 1);
  CHECK(tracer.normals(model, camera, [](double) { return false; }).data.empty());
}

TEST_CASE("normals with mirrors are refused") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(10, 9, 0));
  Tracer tracer(context, {}, mirrors_of({{{-1, -1, 3}, {2, 0, 0}, {0, 2, 0}, {1, 1, 1}}}, 2));
  CHECK_THROWS_AS(tracer.normals(model, reference::cube_camera(8, 8)), UsageError);
}
