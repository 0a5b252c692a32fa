// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <vector>

#include "light/view_tracer.hpp"
#include "unit/trace/trace_fixture.hpp"

namespace raysplats {

struct Traced {
  Image image;
  HostGradients gradients;
};

/// `by_rays`: whatever the model of the camera.
inline Traced trace_and_differentiate(Context& context,
                                      ViewTracer& tracer,
                                      const DeviceGaussians& gaussians,
                                      const Camera& camera,
                                      const std::vector<float>& image_gradient,
                                      bool by_rays = false) {
  if (by_rays) {
    tracer.forward_rays(gaussians, camera, true);
  } else {
    tracer.forward(gaussians, camera, true);
  }
  Buffer<float> gradient(context, image_gradient.size(), "image gradient");
  gradient.upload(image_gradient);
  GaussianGradients out;
  tracer.backward(gaussians, gradient, out);
  return {tracer.download_image(), HostGradients(out)};
}

/// A flat mirror in double precision.
struct Panel {
  glm::dvec3 corner, a, b;  // the rectangle corner + u a + v b
  glm::dvec3 tint;
};

inline Mirrors mirrors_of(const std::vector<Panel>& panels, int max_bounces) {
  Mirrors out;
  out.max_bounces = max_bounces;
  for (const Panel& panel : panels) {
    Mesh mesh;
    for (const glm::dvec3& p : {panel.corner, panel.corner + panel.a,
                                panel.corner + panel.a + panel.b, panel.corner + panel.b}) {
      for (int k = 0; k < 3; ++k) mesh.positions.push_back(static_cast<float>(p[k]));
    }
    mesh.triangles = {0, 1, 2, 0, 2, 3};
    mesh.materials.assign(2, static_cast<std::uint32_t>(out.materials.size()));
    Material material;
    material.kind = Material::Kind::kMirror;
    for (int k = 0; k < 3; ++k)
      material.color[static_cast<std::size_t>(k)] = static_cast<float>(panel.tint[k]);
    out.materials.push_back(material);
    out.meshes.push_back(mesh);
  }
  return out;
}

inline Camera fisheye_camera(int width, int height) {
  Camera camera = reference::cube_camera(width, height);
  camera.model = CameraModel::kFisheye;
  camera.translation = {0.0, 0.0, 2.2};
  camera.fx = camera.fy = 0.35 * width;
  camera.distortion.k1 = -0.03;
  camera.distortion.k2 = 0.004;
  return camera;
}

inline Camera view_of(CameraModel model, int width, int height, double focal) {
  Camera camera = look_at({0.4, -0.3, -2.6}, {0, 0, 0}, {0, -1, 0}, width, height, focal);
  camera.model = model;
  return camera;
}

/// How far pixel i of a picture is from a colour and a coverage, at most of its four channels.
inline double pixel_error(const Image& image,
                          std::size_t i,
                          const glm::dvec3& color,
                          double alpha) {
  double worst = std::abs(static_cast<double>(image.data[4 * i + 3]) - alpha);
  for (int c = 0; c < 3; ++c) {
    const std::size_t at = 4 * i + static_cast<std::size_t>(c);
    worst = std::max(worst, std::abs(static_cast<double>(image.data[at]) - color[c]));
  }
  return worst;
}

}  // namespace raysplats
