// SPDX-License-Identifier: Apache-2.0
// Rays of one's own, forward and backward: a range finder that is fitted to its measurement by
// following the gradient of a ray.
#include <raysplats/context.hpp>
#include <raysplats/error.hpp>
#include <raysplats/tracer.hpp>

#include <cmath>
#include <cstdio>
#include <limits>
#include <vector>

namespace {

// Two balls behind each other on the z axis: near and grey, far and white.
raysplats::Gaussians two_balls() {
  raysplats::Gaussians model;
  model.resize(2);
  model.means = {0, 0, 2, 0, 0, 5};
  model.log_scales.assign(6, std::log(0.3f));
  model.opacities = {0.0f, 3.0f};  // logits: 0.5 and 0.953
  model.sh = {0, 0, 0, 1.7724539f, 1.7724539f, 1.7724539f};
  return model;
}

bool near(const char* what, float value, float expected, float tolerance = 1e-4f) {
  std::printf("%s: %.5f (expected %.5f)\n", what, static_cast<double>(value),
              static_cast<double>(expected));
  return std::abs(value - expected) < tolerance;
}

}  // namespace

int main() {
  try {
    using namespace raysplats;
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    Context context(select_device(""));
    const Model model(context, two_balls());
    Tracer tracer(context);

    // Through both; ending between them; beginning between them; passing beside the first centre.
    // Directions need no unit length: t counts in their lengths.
    const std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 1}, kInfinity},
                                {{0, 0, 0}, 0, {0, 0, 2}, 1.75f},
                                {{0, 0, 0}, 3.5f, {0, 0, 1}, kInfinity},
                                {{0.15f, 0, 0}, 0, {0, 0, 1}, 3.5f}};
    std::vector<RayResult> seen = tracer.trace(model, rays, ColorDirection::kRay, true);
    const float far = 1.0f / (1.0f + std::exp(-3.0f));
    bool good = near("alpha through both", seen[0].alpha, 1.0f - 0.5f * (1.0f - far));
    good = near("colour through both", seen[0].color[0], 0.5f * 0.5f + 0.5f * far) && good;
    good = near("alpha of the near one", seen[1].alpha, 0.5f) && good;
    good = near("its depth in t", seen[1].expected_depth, 1.0f) && good;
    good = near("alpha of the far one", seen[2].alpha, far) && good;
    // At half a standard deviation: exp(-1/2 (0.15 / 0.3)^2).
    good = near("alpha beside the centre", seen[3].alpha, 0.5f * std::exp(-0.125f)) && good;

    // The loss is the alpha of the last ray. Moving its origin outwards by dx loses
    // alpha x / sigma^2 dx, tilting it moves the point nearest to the centre, at t = 2, twice that.
    std::vector<RayResultGradient> gradients(rays.size());
    gradients[3].alpha = 1.0f;
    const RaysGradients back = tracer.backward(model, gradients);
    const float by_origin = -seen[3].alpha * 0.15f / 0.09f;
    good = near("gradient of the origin", back.rays[3].origin[0], by_origin, 1e-3f) && good;
    good = near("gradient of the direction", back.rays[3].direction[0], 2.0f * by_origin, 1e-3f) &&
           good;
    good = near("gradient of the mean", back.parameters.means[0], -by_origin, 1e-3f) && good;
    good =
        near("gradient of the opacity", back.parameters.opacities[0], 0.5f * seen[3].alpha) && good;

    // Aim the ray at the centre: gradient ascent on its origin.
    Ray aimed = rays[3];
    const std::vector<RayResultGradient> one{{{0, 0, 0}, 1.0f}};
    for (int step = 0; step < 40; ++step) {
      tracer.trace(model, std::vector<Ray>{aimed}, ColorDirection::kRay, true);
      aimed.origin[0] += 0.05f * tracer.backward(model, one).rays[0].origin[0];
    }
    return near("x after aiming", aimed.origin[0], 0.0f, 1e-3f) && good ? 0 : 1;
  } catch (const raysplats::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
