// SPDX-License-Identifier: Apache-2.0
#include "render/scene_frames.hpp"

#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/fixture.hpp"

using namespace raysplats;

namespace {

/// A shining square of 2 units that moves 2 units to the right in each of four frames, before a
/// black background; a unit has 5 pixels.
LoadedScene moving_square() {
  LoadedScene out;
  Mesh square;
  square.positions = {-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0};
  square.triangles = {0, 1, 2, 0, 2, 3};
  square.materials = {0, 0};
  Material shining;
  shining.kind = Material::Kind::kEmissive;
  shining.emission = {1, 0.5f, 0};
  out.scene.materials = {shining};
  out.still = {square};
  SceneMesh placement;
  placement.move = {8, 0, 0};
  out.placements = {placement};
  Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 40, 10, 5.0);
  camera.model = CameraModel::kOrthographic;
  out.cameras.assign(4, camera);
  for (std::size_t i = 0; i < 4; ++i) out.cameras[i].name = "frame_" + std::to_string(i);
  out.scene.meshes = out.meshes(0);
  return out;
}

}  // namespace

TEST_CASE("what moves in a scene is drawn as the mean of the shutter's moments") {
  const TemporaryDirectory folder;
  Context context(test_device());
  const LoadedScene scene = moving_square();
  PathTracer tracer(context, scene.scene);
  FrameOptions options;
  const auto row = [&](const char* name) {
    const Image picture = read_image(folder.path() / name);
    std::vector<float> out;
    for (int x = 0; x < picture.width; ++x) out.push_back(picture.at(x, 5, 0));
    return out;
  };
  write_scene_frames(tracer, scene, 0, 4, folder.path(), options);
  const std::vector<float> sharp = row("frame_1.png");
  options.shutter = 1.0;
  options.shutter_samples = 4;
  write_scene_frames(tracer, scene, 0, 4, folder.path(), options);
  const std::vector<float> blurred = row("frame_1.png");
  // The square of frame 1 is [1, 3], and half a unit more to the right at each of the moments.
  for (int x = 0; x < 40; ++x) {
    const double left = (x - 20) / 5.0, right = (x - 19) / 5.0;
    double mean = 0;
    bool edge = false;
    for (int k = 0; k < 4; ++k) {
      const double low = 1 + 0.5 * k, high = 3 + 0.5 * k;
      if (left >= low && right <= high) mean += 0.25;
      for (const double end : {low, high}) edge |= end > left && end < right;
    }
    CAPTURE(x);
    if (left >= 1 && right <= 3) CHECK(sharp[static_cast<std::size_t>(x)] == 1.0f);
    if (!edge) CHECK(blurred[static_cast<std::size_t>(x)] == doctest::Approx(mean).epsilon(0.01));
  }
  // A tracer draws sharp pictures afterwards.
  write_scene_frames(tracer, scene, 1, 2, folder.path(), FrameOptions());
  CHECK(row("frame_1.png") == sharp);
  options.shutter_samples = 0;
  CHECK_THROWS_AS(write_scene_frames(tracer, scene, 0, 1, folder.path(), options), UsageError);
}
