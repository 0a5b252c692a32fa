// SPDX-License-Identifier: Apache-2.0
// Renders Gaussians to a picture: render [MODEL.ply]. Without a model it makes one Gaussian, whose
// picture is known, and checks it.
#include <raysplats/context.hpp>
#include <raysplats/error.hpp>
#include <raysplats/io.hpp>
#include <raysplats/tracer.hpp>

#include <cmath>
#include <cstdio>

namespace {

// A ball of radius 0.2 (one standard deviation) at the origin, red, opacity 0.8.
raysplats::Gaussians red_ball() {
  raysplats::Gaussians model;
  model.resize(1);
  model.log_scales.assign(3, std::log(0.2f));
  model.opacities[0] = std::log(0.8f / 0.2f);     // the logit
  model.sh = {0.5f / 0.28209479f, -2.0f, -2.0f};  // colour = 0.5 + 0.28209479 sh, not below 0
  return model;
}

bool near(const char* what, float value, float expected) {
  std::printf("%s: %.5f (expected %.5f)\n", what, static_cast<double>(value),
              static_cast<double>(expected));
  return std::abs(value - expected) < 1e-4f;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    using namespace raysplats;
    const Gaussians gaussians = argc > 1 ? read_ply(argv[1]) : red_ball();
    Context context(select_device(""));
    const Model model(context, gaussians);

    TraceOptions options;
    options.background = {0.0f, 0.0f, 0.5f};
    options.depth = true;
    Tracer tracer(context, options);
    // From 4 units in front of the origin; y points down in pictures.
    const Camera camera = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 65, 65, 80.0);
    const Image picture = tracer.render(model, camera);
    const Image depth = tracer.depth();
    write_image("render.png", picture);
    std::printf("%zu Gaussians on %s: render.png\n", model.size(), context.device().name.c_str());
    if (argc > 1) return 0;

    // The ray through the middle pixel meets the centre: response 1, so alpha is the opacity.
    bool good = near("alpha in the middle", picture.at(32, 32, 3), 0.8f);
    good = near("red in the middle", picture.at(32, 32, 0), 0.8f) && good;
    good = near("blue in the middle", picture.at(32, 32, 2), 0.2f * 0.5f) && good;
    good = near("depth in the middle", depth.at(32, 32, 0), 4.0f) && good;
    good = near("alpha in the corner", picture.at(0, 0, 3), 0.0f) && good;
    return good ? 0 : 1;
  } catch (const raysplats::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
