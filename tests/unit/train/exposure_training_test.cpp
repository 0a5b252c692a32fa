// SPDX-License-Identifier: Apache-2.0
// Photos whose exposure changes, with and without colours of their own.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kSize = 48;
constexpr int kViews = 20;
constexpr int kSeeds = 3;

// Opaque photos; those for training have gains from 0.7 to 1.4 when `planted`.
Dataset capture(const fs::path& data, const fs::path& photos, bool planted) {
  Dataset dataset = load_dataset(data);
  dataset.alpha_is_background = false;
  const float grey[3] = {0.4f, 0.45f, 0.5f};
  int number = 0;
  for (View& view : dataset.views) {
    Image photo = composite(load_view_image(view), grey);
    const float step = static_cast<float>(number * 7 % kViews) / static_cast<float>(kViews - 1);
    const float gain = planted && !view.test ? 0.7f + 0.7f * step : 1.0f;
    for (float& value : photo.data) value *= 0.65f * gain;
    view.image_path = photos / (std::to_string(number++) + ".png");
    write_image(view.image_path, photo);
  }
  return dataset;
}

TrainOptions options_of(bool exposure) {
  TrainOptions options = short_training(400);
  options.exposure = exposure;
  return options;
}

// The mean of several seeds, whose runs differ by some tenths; the last one's run stays in `run`.
double corrected(Context& context, const Dataset& dataset, const fs::path& run, bool exposure) {
  double sum = 0;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    TrainOptions options = options_of(exposure);
    options.seed = static_cast<std::uint64_t>(seed);
    fs::remove_all(run);
    Trainer trainer(context, dataset, options, run);
    sum += trainer.run(false).evaluations.back().psnr_corrected;
  }
  return sum / kSeeds;
}

}  // namespace

TEST_CASE("planted gains cost nothing when every photo has a colour of its own") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kViews, 5);
  const Dataset plain = capture(data, folder.path() / "plain", false);
  const Dataset gains = capture(data, folder.path() / "gains", true);
  const double clean = corrected(context, plain, folder.path() / "clean", false);
  const double modelled = corrected(context, gains, folder.path() / "modelled", true);
  const double ignored = corrected(context, gains, folder.path() / "ignored", false);
  MESSAGE("clean " << clean << " dB, modelled " << modelled << ", ignored " << ignored);
  CHECK(modelled > ignored + 3);
  CHECK(modelled > clean - 0.5);

  // The run folder says what the photos' colours are: the brightest one's matrix is largest.
  std::ifstream stream(folder.path() / "modelled/exposures.json");
  const nlohmann::json exposures = nlohmann::json::parse(stream);
  REQUIRE(exposures.size() == kViews);
  double least = 10, most = 0, sum = 0;
  for (const auto& [name, rows] : exposures.items()) {
    const double green = rows[1][0].get<double>() + rows[1][1].get<double>() +
                         rows[1][2].get<double>() + rows[1][3].get<double>();
    least = std::min(least, green);
    most = std::max(most, green);
    sum += rows[1][1].get<double>() / kViews;
  }
  CHECK(sum == doctest::Approx(1.0).epsilon(1e-5));
  CHECK(most > least + 0.4);
}

TEST_CASE("a resumed run goes on with the photos' colours, bit for bit") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, 24, 6, 2);
  const Dataset gains = capture(data, folder.path() / "gains", true);
  TrainOptions options = options_of(true);
  options.iterations = 40;
  options.max_gaussians = 600;
  options.trace.deterministic = true;
  Trainer whole(context, gains, options, folder.path() / "whole");
  whole.run(false);
  options.checkpoint_every = 17;
  Trainer part(context, gains, options, folder.path() / "part");
  part.step(17);
  part.save();
  Trainer rest(context, gains, options, folder.path() / "rest");
  rest.resume(folder.path() / "part");
  rest.run(false);
  CHECK(rest.model().sh == whole.model().sh);
  CHECK(rest.model().means == whole.model().means);
  const auto bytes = [](const fs::path& path) {
    std::ifstream stream(path);
    return std::string(std::istreambuf_iterator<char>(stream), {});
  };
  CHECK(bytes(folder.path() / "rest/exposures.json") ==
        bytes(folder.path() / "whole/exposures.json"));
  CHECK(bytes(folder.path() / "rest/exposures.json").size() > 100);
  options.exposure = false;
  Trainer other(context, gains, options, folder.path() / "other");
  CHECK_THROWS_AS(other.resume(folder.path() / "part"), UsageError);
}
