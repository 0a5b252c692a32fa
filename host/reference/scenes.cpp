// SPDX-License-Identifier: Apache-2.0
#include "reference/scenes.hpp"

#include <cmath>

#include "util/rng.hpp"

namespace raysplats::reference {

Gaussians random_scene(std::size_t count, std::uint64_t seed, int sh_degree) {
  Gaussians out;
  out.sh_degree = sh_degree;
  out.resize(count);
  CounterRng rng(seed, 0);
  const double size = 2.4 / std::sqrt(static_cast<double>(count));
  for (float& x : out.means) x = static_cast<float>(2.0 * rng.uniform() - 1.0);
  for (float& q : out.quaternions) q = static_cast<float>(rng.normal());
  for (float& s : out.log_scales) s = static_cast<float>(std::log(size) + 0.5 * rng.normal());
  for (float& a : out.opacities) a = static_cast<float>(-1.5 + 1.5 * rng.normal());
  for (float& c : out.sh) c = static_cast<float>(rng.normal());
  return out;
}

Camera cube_camera(int width, int height) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 1.5 * width;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.translation = glm::dvec3(0.0, 0.0, 4.0);
  return camera;
}

Camera posed(
    CameraModel model, int width, int height, double fx, double fy, const Distortion& distortion) {
  Camera camera = look_at({1.5, -0.7, 2.0}, {-0.3, 0.4, 0.1}, {0.1, -1, 0.2}, width, height, fx);
  camera.fy = fy;
  camera.cx += 3.25;
  camera.cy -= 1.75;
  camera.model = model;
  camera.distortion = distortion;
  return camera;
}

}  // namespace raysplats::reference
