// SPDX-License-Identifier: Apache-2.0
// Trains in a loop of one's own: takes photos of a few known Gaussians, writes them as a data set,
// trains on it, looks at it in between, stops when it is good enough, saves and goes on from there.
#include <raysplats/context.hpp>
#include <raysplats/dataset.hpp>
#include <raysplats/error.hpp>
#include <raysplats/io.hpp>
#include <raysplats/tracer.hpp>
#include <raysplats/trainer.hpp>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string>
#include <vector>

namespace {

// Twelve balls on a ring, in colours around the wheel.
raysplats::Gaussians ring() {
  raysplats::Gaussians model;
  model.resize(12);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float angle = 0.5236f * static_cast<float>(i);
    model.means[3 * i] = 0.6f * std::cos(angle);
    model.means[3 * i + 1] = 0.6f * std::sin(angle);
    for (std::size_t k = 0; k < 3; ++k) {
      model.log_scales[3 * i + k] = std::log(0.12f);
      model.sh[3 * i + k] = 1.5f * std::cos(angle + 2.0944f * static_cast<float>(k));
    }
    model.opacities[i] = 3.0f;
  }
  return model;
}

// images/view_NN.png and transforms.json, as the other tools write them.
void take_photos(raysplats::Context& context, const std::filesystem::path& folder) {
  using namespace raysplats;
  const Model model(context, ring());
  Tracer tracer(context);
  std::vector<Camera> cameras;
  std::filesystem::create_directories(folder / "images");
  for (int i = 0; i < 16; ++i) {
    const double angle = 0.3927 * i;
    Camera camera =
        look_at({3 * std::cos(angle), 3 * std::sin(angle), 1.2}, {0, 0, 0}, {0, 0, 1}, 48, 40, 56);
    camera.name = "images/view_" + std::to_string(i) + ".png";
    const Image seen = tracer.render(model, camera);
    Image photo(seen.width, seen.height, 3);
    for (std::size_t p = 0; p < photo.pixels(); ++p) {
      for (std::size_t c = 0; c < 3; ++c) photo.data[3 * p + c] = seen.data[4 * p + c];
    }
    write_image(folder / camera.name, photo);
    cameras.push_back(camera);
  }
  write_cameras(folder / "transforms.json", cameras);
}

raysplats::TrainOptions options() {
  raysplats::TrainOptions out;
  out.iterations = 400;
  out.init_count = 300;
  out.sh_degree = 0;
  out.densify_until = 0;
  out.resolution_schedule = {};
  return out;
}

}  // namespace

int main() {
  try {
    using namespace raysplats;
    Context context(select_device(""));
    take_photos(context, "photos");
    const Dataset dataset = load_dataset("photos");

    double first = 0, good = 0;
    std::int64_t stopped = 0;
    {
      Trainer trainer(context, dataset, options(), "run");
      std::int64_t heard = 0;
      trainer.on_step([&](const TrainProgress& progress) {
        ++heard;
        if (progress.iteration == 1) first = trainer.evaluate().psnr;
      });
      while (trainer.step(50)) {
        good = trainer.evaluate().psnr;
        std::printf("iteration %d: loss %.4f, %.2f dB on views held out\n",
                    static_cast<int>(trainer.iteration()), trainer.loss().total, good);
        if (good > first + 8.0) break;
      }
      trainer.save();
      stopped = trainer.iteration();
      if (heard != stopped) return 1;
    }
    std::printf("%.2f dB after one iteration, %.2f dB after %d\n", first, good,
                static_cast<int>(stopped));

    // Another day: the rest of the run, with everything that its schedule says.
    Trainer again(context, dataset, options(), "run");
    again.resume("latest");
    const bool resumed = again.iteration() == stopped;
    const TrainSummary summary = again.run(false);
    const double last = summary.evaluations.back().psnr;
    std::printf("%.2f dB after all %d: run/point_cloud has the model\n", last,
                static_cast<int>(summary.iterations));
    const bool whole = summary.iterations == 400 && again.model().size() == 300;
    return resumed && whole && good > first + 8.0 && last > first + 8.0 ? 0 : 1;
  } catch (const raysplats::Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return error.exit_code();
  }
}
