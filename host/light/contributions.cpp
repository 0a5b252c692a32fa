// SPDX-License-Identifier: Apache-2.0
#include "raysplats/contributions.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "raysplats/error.hpp"
#include "raysplats/image.hpp"
#include "raysplats/model.hpp"
#include "raysplats/tracer.hpp"
#include "scene/even_choice.hpp"
#include "shared/sh.h"

namespace raysplats {
namespace {

constexpr double kMostPixels = 6e5;  // of a view

/// Without what hides the gradient of a colour: all are 0.5, which no bound meets.
Gaussians in_grey(const Gaussians& model) {
  Gaussians out = model;
  out.sh_degree = 0;
  out.sh.assign(3 * model.size(), 0.0f);
  return out;
}

}  // namespace

std::vector<double> contributions(Context& context,
                                  const Gaussians& model,
                                  std::span<const Camera> cameras,
                                  TraceOptions trace,
                                  const Mirrors& mirrors,
                                  const std::function<bool(double)>& within) {
  if (cameras.empty()) throw UsageError("Contributions are to the pictures of views: give cameras");
  trace.background = {};
  trace.sky = {};
  trace.depth = false;
  const Model on_device(context, in_grey(model));
  Tracer tracer(context, trace, mirrors);
  const std::vector<std::size_t> views = even_choice(cameras.size(), kMostContributionViews);
  std::vector<double> out(model.size());
  std::function<bool(double)> watch;
  double done = 0;  // views
  if (within) {
    watch = [&](double share) {
      return within((done + share) / static_cast<double>(views.size()));
    };
  }
  for (const std::size_t v : views) {
    const Camera& view = cameras[v];
    const double pixels = static_cast<double>(view.width) * view.height;
    const Camera camera = downscaled(view, std::max(1.0, std::sqrt(pixels / kMostPixels)));
    if (tracer.render(on_device, camera, true, watch).data.empty()) return {};
    // The derivative of the picture's red by a Gaussian's is the sum of its shares.
    Image of_red(camera.width, camera.height, 4);
    for (std::size_t i = 0; i < of_red.pixels(); ++i) of_red.data[4 * i] = 1.0f;
    const Gaussians gradient = tracer.backward(on_device, of_red).parameters;
    const double share = 1.0 / (RS_SH0 * static_cast<double>(of_red.pixels() * views.size()));
    for (std::size_t i = 0; i < out.size(); ++i)
      out[i] += share * static_cast<double>(gradient.sh[3 * i]);
    ++done;
  }
  return out;
}

}  // namespace raysplats
