// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/shadow_bias.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>

using namespace raysplats;

namespace {

/// Ten Gaussians along each side of the cube [-1, 1]^3.
Scene cube() {
  Scene scene;
  constexpr std::size_t kSide = 10;
  scene.gaussians.resize(kSide * kSide * kSide);
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i) {
    const std::size_t places[] = {i % kSide, i / kSide % kSide, i / kSide / kSide};
    for (std::size_t k = 0; k < 3; ++k) {
      scene.gaussians.means[3 * i + k] =
          2.0f * static_cast<float>(places[k]) / (static_cast<float>(kSide) - 1.0f) - 1.0f;
      scene.gaussians.log_scales[3 * i + k] = std::log(0.02f);
    }
  }
  return scene;
}

}  // namespace

TEST_CASE("the bias of shadow rays is a thousandth of the size of the Gaussians") {
  Scene scene = cube();
  const float bias = shadow_bias(scene);
  CHECK(bias == doctest::Approx(1e-3 * std::sqrt(12.0)).epsilon(0.2));
  // One that went astray, a ground under everything.
  scene.gaussians.means[0] = 1e6f;
  Mesh ground;
  ground.positions = {-1e4f, 1, -1e4f, 1e4f, 1, -1e4f, 1e4f, 1, 1e4f};
  ground.triangles = {0, 1, 2};
  ground.materials = {0};
  scene.meshes.push_back(ground);
  CHECK(shadow_bias(scene) == doctest::Approx(bias).epsilon(0.05));
  scene.render.bias = 0.25f;
  CHECK(shadow_bias(scene) == 0.25f);
  Scene vast = cube();
  for (float& scale : vast.gaussians.log_scales) scale = 300.0f;
  CHECK(shadow_bias(vast) == std::numeric_limits<float>::max());
}
