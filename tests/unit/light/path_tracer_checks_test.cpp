// SPDX-License-Identifier: Apache-2.0
// What a path tracer refuses.
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/path_tracer.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;

TEST_CASE("pictures without all of their data are refused") {
  Context context = make_test_context();
  Scene scene = cloud_scene(2);
  scene.environment.equirect = waves(64, 32);
  scene.environment.equirect.data.pop_back();
  CHECK_THROWS_AS(PathTracer(context, scene), UsageError);
  scene = cloud_scene(2);
  scene.textures = {waves(8, 8)};
  scene.textures[0].data.clear();
  CHECK_THROWS_AS(PathTracer(context, scene), UsageError);
}

TEST_CASE("meshes with a number that is not finite are refused, and the ones before stay") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.7, 8, 0, true), diffuse({0.7f, 0.2f, 0.4f}));
  Mesh& sound = scene.meshes[0];
  sound.uvs.assign(2 * sound.vertex_count(), 0.5f);
  PathTracer tracer(context, scene);
  const Image picture = tracer.render(kCamera);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    for (std::vector<float> Mesh::*const numbers : {&Mesh::positions, &Mesh::normals, &Mesh::uvs}) {
      Scene broken = scene;
      (broken.meshes[0].*numbers).at(4) = bad;
      CHECK_THROWS_AS(PathTracer(context, broken), DataError);
      CHECK_THROWS_AS(tracer.set_meshes(broken.meshes), DataError);
    }
  }
  CHECK(tracer.render(kCamera).data == picture.data);
}

TEST_CASE("an environment that is not finite is refused, and so is a camera that scales") {
  Context context = make_test_context();
  const Scene sound = cloud_scene(2);
  for (const float value :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Scene scene = sound;
    scene.environment.rotation = value;
    CHECK_THROWS_AS(PathTracer(context, scene), UsageError);
    scene = sound;
    scene.environment.up[1] = value;
    CHECK_THROWS_AS(PathTracer(context, scene), UsageError);
  }
  PathTracer tracer(context, sound);
  Camera camera = kCamera;
  camera.rotation *= 2.0;
  CHECK_THROWS_AS(tracer.render(camera), UsageError);
}
