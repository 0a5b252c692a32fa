// SPDX-License-Identifier: Apache-2.0
// Photos of a few coloured Gaussians, for runs that learn them.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "light/view_tracer.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"
#include "raysplats/mirrors.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

namespace raysplats {

/// So many coloured Gaussians, whose means lie within `reach` of the origin along each axis;
/// `opacity` before the sigmoid.
inline Gaussians coloured_cloud(std::size_t count,
                                double reach,
                                std::uint64_t seed,
                                float opacity = 2.0f) {
  CounterRng rng(seed, 3);
  Gaussians out;
  out.resize(count);
  for (std::size_t i = 0; i < 3 * count; ++i) {
    out.means[i] = static_cast<float>(reach * (2.0 * rng.uniform() - 1.0));
    out.log_scales[i] = static_cast<float>(std::log(0.05 + 0.15 * rng.uniform()));
    out.sh[i] = static_cast<float>(3.0 * rng.uniform() - 1.5);
  }
  for (float& value : out.opacities) value = opacity;
  return out;
}

/// Their photos from some cameras, every fifth of which is held out, in a folder that goes with the
/// object.
struct Photographed {
  TemporaryDirectory folder;
  Context context{test_device()};
  Dataset dataset;

  Photographed(const Gaussians& truth,
               const std::vector<Camera>& cameras,
               const Mirrors& mirrors = {}) {
    std::filesystem::create_directories(folder / "images");
    dataset.root = folder.path();
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, truth, ScaleActivation::kExp);
    ViewTracer tracer(context, TraceOptions{}, mirrors);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      View view;
      view.camera = cameras[i];
      view.camera.name = "view_" + std::to_string(i) + ".png";
      view.source_camera = view.camera;
      view.image_path = folder / "images" / view.camera.name;
      view.test = i % 5 == 0;
      tracer.forward(gaussians, view.camera);
      const Image traced = tracer.download_image();
      Image rgb(traced.width, traced.height, 3);
      for (std::size_t p = 0; p < rgb.pixels(); ++p) {
        for (std::size_t c = 0; c < 3; ++c) rgb.data[3 * p + c] = traced.data[4 * p + c];
      }
      write_image(view.image_path, rgb);
      dataset.views.push_back(view);
    }
  }
};

}  // namespace raysplats
