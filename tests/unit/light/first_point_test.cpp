// SPDX-License-Identifier: Apache-2.0
// What a ray of a camera meets first, where it can be said by hand.
#include <cmath>
#include <glm/geometric.hpp>
#include <optional>

#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::rectangle;
using reference::white;

namespace {

constexpr double kOff = 1e-5;  // of single precision

/// Balls of radius 0.05 or so on the z axis, each with the share of light that its middle takes.
Scene balls(const std::vector<std::array<double, 2>>& at_and_alpha) {
  Scene scene;
  scene.materials = {white(Material::Kind::kDiffuse)};  // of walls
  Gaussians& all = scene.gaussians;
  all.resize(at_and_alpha.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& [z, alpha] = at_and_alpha[i];
    all.means[3 * i + 2] = static_cast<float>(z);
    for (std::size_t k = 0; k < 3; ++k) all.log_scales[3 * i + k] = std::log(0.05f);
    all.opacities[i] = static_cast<float>(std::log(alpha / (1.0 - alpha)));
    all.sh.resize(3 * all.size());
  }
  return scene;
}

Mesh wall(double z) { return rectangle({0, 0, z}, {1, 0, 0}, {0, 1, 0}, 0); }

/// From z = -4 towards the origin.
Camera ahead(int side = 1) {
  return look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, side, side, 1.5 * side);
}

void check_point(PathTracer& tracer, const Camera& camera, const glm::dvec3& expected) {
  const std::optional<glm::dvec3> point = tracer.first_point(camera);
  REQUIRE(point);
  CHECK(glm::distance(*point, expected) < kOff * glm::distance(camera.center(), expected));
}

}  // namespace

TEST_CASE("the nearer of Gaussians and surfaces is met first [small]") {
  Context context = make_test_context();
  Scene scene = balls({{0.0, 0.9}});
  PathTracer tracer(context, scene);
  check_point(tracer, ahead(), {0, 0, 0});
  tracer.set_meshes({wall(1.0)});
  check_point(tracer, ahead(), {0, 0, 0});
  tracer.set_meshes({wall(1.0), wall(-1.0)});
  check_point(tracer, ahead(), {0, 0, -1});
  tracer.set_meshes({});
  check_point(tracer, ahead(), {0, 0, 0});
  // The other way there is neither.
  CHECK(!tracer.first_point(look_at({0, 0, -4}, {0, 0, -5}, {0, -1, 0}, 1, 1, 1.5)));
}

TEST_CASE("Gaussians are met where half of the light is gone, surfaces of any material [small]") {
  Context context = make_test_context();
  // 0.6, then 0.36 of the light is left.
  Scene scene = balls({{0.0, 0.4}, {1.0, 0.4}});
  PathTracer thin(context, scene);
  check_point(thin, ahead(), {0, 0, 1});
  thin.set_meshes({wall(0.5)});
  check_point(thin, ahead(), {0, 0, 0.5});
  for (const Material::Kind kind : {Material::Kind::kMirror, Material::Kind::kGlass}) {
    Scene one = balls({{0.0, 0.4}});
    PathTracer nothing(context, one);
    CHECK(!nothing.first_point(ahead()));
    add_mesh(one, wall(2.0), white(kind));
    PathTracer tracer(context, one);
    check_point(tracer, ahead(), {0, 0, 2});
  }
}

TEST_CASE("the ray is that of the picture's middle, through every lens [small]") {
  Context context = make_test_context();
  Scene scene = balls({{9.0, 0.9}});
  add_mesh(scene, wall(0.0), white(Material::Kind::kDiffuse));
  PathTracer tracer(context, scene);
  Camera camera = ahead(2);  // the middle of its last pixel is half a pixel off
  check_point(tracer, camera, {4.0 * 0.5 / 3.0, 4.0 * 0.5 / 3.0, 0});
  camera.cx += 0.5;
  camera.cy += 0.5;
  check_point(tracer, camera, {0, 0, 0});
  camera.model = CameraModel::kFisheye;
  check_point(tracer, camera, {0, 0, 0});
  // A panorama of one pixel looks ahead.
  camera = ahead();
  camera.model = CameraModel::kEquirectangular;
  check_point(tracer, camera, {0, 0, 0});
  camera.width = 0;
  CHECK_THROWS_AS(tracer.first_point(camera), UsageError);
}
