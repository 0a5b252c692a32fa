// SPDX-License-Identifier: Apache-2.0
// What the rays of a picture meet first: by hand, hit by hit in double precision, and, where there
// are no surfaces, against the tracer of models.
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "raysplats/error.hpp"
#include "raysplats/tracer.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::rectangle;
using reference::white;

namespace {

constexpr double kClose = 5e-4;

/// A flat ball at z, thin along z, whose middle takes `alpha` of the light.
Scene disc(double z, double alpha) {
  Scene scene;
  scene.materials = {white(Material::Kind::kMirror)};
  Gaussians& all = scene.gaussians;
  all.resize(1);
  all.means[2] = static_cast<float>(z);
  all.log_scales = {std::log(0.5f), std::log(0.5f), std::log(0.05f)};
  all.quaternions = {1, 0, 0, 0};
  all.opacities[0] = static_cast<float>(std::log(alpha / (1.0 - alpha)));
  all.sh.resize(3);
  return scene;
}

Mesh wall(double z) { return rectangle({0, 0, z}, {4, 0, 0}, {0, 4, 0}, 0); }

/// One pixel, from z = -4 along z.
Camera ahead() { return look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 1, 1, 1.5); }

void check_pixel(PathTracer& tracer, double expected, double median, double hits, double normal) {
  const PathTracer::FirstHits first = tracer.first_hits(ahead());
  CHECK(first.depth.at(0, 0, 0) == doctest::Approx(expected).epsilon(1e-4));
  CHECK(first.depth.at(0, 0, 1) == doctest::Approx(median).epsilon(1e-4));
  CHECK(first.depth.at(0, 0, 2) == hits);
  CHECK(first.normals.at(0, 0, 2) == doctest::Approx(normal).epsilon(1e-4));
}

/// Where the ray of a pixel meets the plane of a wall.
double distance_to(const CameraRay& ray, const glm::dvec3& point, const glm::dvec3& normal) {
  return glm::dot(point - ray.origin, normal) / glm::dot(ray.direction, normal);
}

double worst_of(const Image& a, const Image& b, std::size_t channels) {
  REQUIRE(a.pixels() == b.pixels());
  double worst = 0;
  const auto of_a = static_cast<std::size_t>(a.channels);
  const auto of_b = static_cast<std::size_t>(b.channels);
  for (std::size_t i = 0; i < a.pixels(); ++i) {
    for (std::size_t c = 0; c < channels; ++c) {
      worst = std::max(worst, std::abs(static_cast<double>(a.data[of_a * i + c]) -
                                       static_cast<double>(b.data[of_b * i + c])));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("depths and normals of Gaussians and surfaces before and behind each other [small]") {
  Context context = make_test_context();
  const Scene scene = disc(0.0, 0.4);
  PathTracer tracer(context, scene);
  check_pixel(tracer, 4, 0, 1, -0.4);
  // The mirror behind takes the rest of the ray; its normal looks back too.
  tracer.set_meshes({wall(2)});
  check_pixel(tracer, 0.4 * 4 + 0.6 * 6, 6, 1, -1);
  tracer.set_meshes({wall(-1), wall(2)});
  check_pixel(tracer, 3, 3, 0, -1);
  tracer.set_meshes({});
  check_pixel(tracer, 4, 0, 1, -0.4);
  // More than half of the light ends before the surface.
  PathTracer dense(context, disc(0.0, 0.9));
  dense.set_meshes({wall(2)});
  check_pixel(dense, 0.9 * 4 + 0.1 * 6, 4, 1, -1);
  CHECK(dense.first_hits(ahead()).alpha.at(0, 0, 0) == 1.0f);
  // Nothing at all.
  const PathTracer::FirstHits away =
      dense.first_hits(look_at({0, 0, -4}, {0, 0, -5}, {0, -1, 0}, 1, 1, 1.5));
  CHECK(away.alpha.at(0, 0, 0) == 0.0f);
  CHECK(away.depth.data == std::vector<float>(3, 0.0f));
}

TEST_CASE("without surfaces first hits are the depths, normals and hits of the model [small]") {
  Context context = make_test_context();
  Scene scene = cloud_scene(2);
  const Model model(context, scene.gaussians);
  Camera camera = reference::cube_camera(24, 20);
  for (const auto& [lens, footprint] :
       {std::pair(CameraModel::kPinhole, 0.0f), std::pair(CameraModel::kFisheye, 0.0f),
        std::pair(CameraModel::kPinhole, 6.0f)}) {
    camera.model = lens;
    scene.trace.view_footprint = footprint;
    TraceOptions options = scene.trace;
    options.depth = true;
    // First hits are of cones, with which packets agree to first order alone.
    if (footprint > 0) options.traversal = Traversal::kBvh;
    Tracer plain(context, options);
    PathTracer tracer(context, scene);
    const Image rgba = plain.render(model, camera);
    const PathTracer::FirstHits first = tracer.first_hits(camera);
    const Image depth = plain.depth();
    CHECK(worst_of(first.depth, depth, 1) < 2e-3);
    CHECK(worst_of(first.normals, plain.normals(model, camera), 3) < kClose);
    std::size_t same = 0;
    std::size_t met = 0;
    for (std::size_t i = 0; i < rgba.pixels(); ++i) {
      CHECK(std::abs(first.alpha.data[i] - rgba.data[4 * i + 3]) < kClose);
      same += first.depth.data[3 * i + 2] == depth.data[3 * i + 2] ? 1 : 0;
      met += depth.data[3 * i + 2] > 0 ? 1 : 0;
    }
    CHECK(same * 100 >= 98 * rgba.pixels());
    CHECK(met > rgba.pixels() / 4);
  }
}

TEST_CASE("first hits equal those of a double reference with a wall among Gaussians [small]") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  const glm::dvec3 u(2, 0, 1), v(0, 2, 0.3);
  const glm::dvec3 normal = glm::normalize(glm::cross(u, v));
  add_mesh(scene, rectangle({0, 0, 0.1}, 3.0 * u, 3.0 * v, 0), white(Material::Kind::kGlass));
  const Camera camera = reference::cube_camera(24, 20);
  const PathTracer::FirstHits first = PathTracer(context, scene).first_hits(camera);
  const reference::Parameters parameters(scene.gaussians);
  const glm::dvec3 axis = glm::transpose(camera.rotation)[2];
  std::size_t compared = 0, mixed = 0;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
      const double end = distance_to(ray, {0, 0, 0.1}, normal);
      REQUIRE(end > 0);
      const reference::RayTrace trace =
          reference::trace_ray(parameters, scene.trace, ray.origin, ray.direction, 0.0, end,
                               reference::ColorMode::kFromOrigin);
      if (trace.margin < 1e-4) continue;
      ++compared;
      mixed += trace.alpha > 0.1 && trace.alpha < 0.9 ? 1 : 0;
      const double cosine = glm::dot(axis, ray.direction) / glm::length(ray.direction);
      const double cloud = std::min(trace.expected_depth, end);
      const double expected = trace.alpha * cloud + (1 - trace.alpha) * end;
      const double median = trace.median_depth > 0 ? std::min(trace.median_depth, end) : end;
      const double scale = cosine * glm::length(ray.direction);
      CHECK(std::abs(first.depth.at(x, y, 0) - expected * scale) < kClose);
      CHECK(std::abs(first.depth.at(x, y, 1) - median * scale) < kClose);
      CHECK(first.depth.at(x, y, 2) == static_cast<float>(trace.hits.size()));
      CHECK(first.alpha.at(x, y, 0) == 1.0f);
    }
  }
  CHECK(compared * 10 > 8 * first.alpha.pixels());
  CHECK(mixed > first.alpha.pixels() / 20);
}

TEST_CASE("first hits can be watched and stopped [small]") {
  Context context = make_test_context();
  PathTracer tracer(context, disc(0.0, 0.4));
  int calls = 0;
  const auto stop = [&](double share) {
    ++calls;
    return share < 0.5;
  };
  const Camera camera = reference::cube_camera(300, 300);  // more rays than between two looks
  CHECK(tracer.first_hits(camera, stop).alpha.data.empty());
  CHECK(calls == 1);
  CHECK(tracer.first_hits(camera, [](double) { return true; }).depth.data ==
        tracer.first_hits(camera).depth.data);
  Camera none = camera;
  none.width = 0;
  CHECK_THROWS_AS(tracer.first_hits(none), UsageError);
}
