// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <string>

#include "light/view_tracer.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/train/short_training.hpp"

namespace raysplats {
namespace {

namespace fs = std::filesystem;

// Cut-out photos of a body that is as white as what is put behind it.
Dataset white_body(const fs::path& data, const fs::path& photos) {
  make_photos(data, 48, 20, 4);
  Dataset dataset = load_dataset(data);
  REQUIRE(dataset.alpha_is_background);
  fs::create_directories(photos);
  for (View& view : dataset.views) {
    Image photo = load_view_image(view);
    REQUIRE(photo.channels == 4);
    for (std::size_t i = 0; i < photo.data.size(); ++i) {
      if (i % 4 != 3) photo.data[i] = 1.0f;
    }
    view.image_path = photos / ((view.test ? "test_" : "") + view.camera.name + ".png");
    fs::create_directories(view.image_path.parent_path());
    write_image(view.image_path, photo);
  }
  return dataset;
}

// Mean error of the coverage that a model has in the held-out photos.
double coverage_error(Context& context, const Dataset& dataset, const Gaussians& model) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  ViewTracer tracer(context, TraceOptions{});
  double sum = 0, pixels = 0;
  for (const View& view : dataset.views) {
    if (!view.test) continue;
    tracer.forward(gaussians, view.camera);
    const Image shown = tracer.download_image(), photo = load_view_image(view);
    REQUIRE(shown.pixels() == photo.pixels());
    for (std::size_t i = 3; i < photo.data.size(); i += 4) {
      sum += std::abs(static_cast<double>(shown.data[i]) - static_cast<double>(photo.data[i]));
      pixels += 1;
    }
  }
  return sum / pixels;
}

}  // namespace

TEST_CASE("a cut-out body in the colour of what is put behind it is part of the model") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const Dataset dataset = white_body(folder.path() / "data", folder.path() / "photos");
  const auto error = [&](double alpha_weight) {
    TrainOptions options = short_training(200);
    options.background = "1,1,1";
    options.alpha_weight = alpha_weight;
    // By colours alone every Gaussian becomes too faint to be kept.
    if (alpha_weight == 0) options.densify_until = 0;
    Trainer trainer(context, dataset, options, folder.path() / "run", true);
    trainer.run(false);
    return coverage_error(context, dataset, trainer.model());
  };
  const double by_colours = error(0), by_coverage = error(TrainOptions().alpha_weight);
  MESSAGE("mean error of coverage: " << by_colours << " by colours alone, " << by_coverage);
  CHECK(by_colours > 0.1);
  CHECK(by_coverage < 0.04);
}

}  // namespace raysplats
