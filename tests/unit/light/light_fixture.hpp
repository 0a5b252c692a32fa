// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "raysplats/path_tracer.hpp"
#include "reference/light.hpp"
#include "reference/light_scenes.hpp"
#include "reference/scenes.hpp"
#include "unit/trace/trace_fixture.hpp"

namespace raysplats {

inline const Camera kCamera = reference::cube_camera(24, 24);

/// Forty Gaussians in the cube [-1, 1]^3, with room between them to see what lies behind, under a
/// dim sky.
inline Scene cloud_scene(int sh_degree = 0) {
  Scene scene;
  scene.gaussians = reference::gaussian_cloud(40, 21, {-1, -1, -1}, {1, 1, 1}, 0.13, sh_degree);
  scene.environment.color = {0.25f, 0.3f, 0.4f};
  scene.environment.up = {0, -1, 0};
  return scene;
}

/// Above and beside the camera of cube_camera(), which is at z = -4 with -y upwards.
inline Light lamp() {
  Light light;
  light.position = {1.0f, -2.5f, -2.0f};
  light.color = {9.0f, 8.0f, 6.0f};
  return light;
}

inline void add_mesh(Scene& scene, Mesh mesh, const Material& material) {
  for (std::uint32_t& index : mesh.materials) {
    index = static_cast<std::uint32_t>(scene.materials.size());
  }
  scene.materials.push_back(material);
  scene.meshes.push_back(std::move(mesh));
}

inline Material diffuse(const Rgb& color) {
  Material out;
  out.color = color;
  return out;
}

/// A floor under the cloud (y points down).
inline void add_floor(Scene& scene) {
  add_mesh(scene, reference::rectangle({0, 1.1, 0}, {3, 0, 0}, {0, 0.1, 3}, 0),
           diffuse({0.8f, 0.7f, 0.5f}));
}

/// An environment whose colour changes slowly with both angles.
inline Image waves(int width, int height) {
  Image out(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = 6.2831853 * (x + 0.5) / width, v = 3.1415926 * (y + 0.5) / height;
      out.at(x, y, 0) = static_cast<float>(0.6 + 0.4 * std::sin(u) * std::sin(v));
      out.at(x, y, 1) = static_cast<float>(0.5 + 0.4 * std::cos(v));
      out.at(x, y, 2) = static_cast<float>(0.5 + 0.3 * std::cos(2 * u) * std::sin(v) * std::sin(v));
    }
  }
  return out;
}

inline Image render_on_device(Context& context, const Scene& scene, const Camera& camera) {
  return PathTracer(context, scene).render(camera);
}

/// RGBA means over the picture.
inline std::array<double, 4> mean_of(const Image& image) {
  std::array<double, 4> out{};
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    out[i % 4] += image.data[i] / static_cast<double>(image.pixels());
  }
  return out;
}

inline double largest_difference(const Image& a, const Image& b) {
  double out = a.data.size() == b.data.size() ? 0.0 : 1e30;
  for (std::size_t i = 0; i < std::min(a.data.size(), b.data.size()); ++i) {
    const double d = std::abs(static_cast<double>(a.data[i]) - b.data[i]);
    out = std::max(out, d <= 1e30 ? d : 1e30);
  }
  return out;
}

constexpr double kTolerance = 1e-4;
// The light of an environment's picture on a surface is nine coefficients; the reference adds up
// the picture.
constexpr double kLitByPicture = 1.5e-3;

/// A picture of one sample per pixel against the reference: every pixel within `tolerance`, but for
/// those with a decision within `tie` of going the other way and those where the device chooses by
/// chance, of which there may be `excused_share`.
inline void check_picture(Context& context,
                          const Scene& scene,
                          const Camera& camera,
                          const std::string& what,
                          double tolerance = kTolerance,
                          double excused_share = 0.02,
                          double tie = 3e-5) {
  CAPTURE(what);
  const Image image = render_on_device(context, scene, camera);
  const reference::LightRender expected = reference::render_light(scene, camera);
  REQUIRE(image.channels == 4);
  REQUIRE(image.pixels() == expected.pixels());
  double worst = 0, mean = 0;
  std::size_t excused = 0, worst_pixel = 0;
  for (std::size_t i = 0; i < expected.pixels(); ++i) {
    const bool skip = expected.margin[i] < tie || expected.chance[i] > 1e-3;
    excused += skip ? 1 : 0;
    for (std::size_t c = 0; c < 4; ++c) {
      const double d = std::abs(image.data[4 * i + c] - expected.image[c * expected.pixels() + i]);
      CHECK(d <= 1e30);
      if (skip) continue;
      mean += d / static_cast<double>(4 * expected.pixels());
      if (d > worst) {
        worst = d;
        worst_pixel = i;
      }
    }
  }
  const auto width = static_cast<std::size_t>(expected.width);
  CAPTURE(worst_pixel % width);
  CAPTURE(worst_pixel / width);
  CAPTURE(expected.margin[worst_pixel]);
  MESSAGE(what, ": maximum ", worst, ", mean ", mean, ", excused ", excused, " of ",
          expected.pixels());
  CHECK(worst < tolerance);
  CHECK(mean < 0.05 * tolerance);
  CHECK(static_cast<double>(excused) <= excused_share * static_cast<double>(expected.pixels()));
}

}  // namespace raysplats
