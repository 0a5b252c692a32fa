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
constexpr double kGrey = 0.3;  // typical of what photos show

// The gain of a photo for training, from 0.7 to 1.4.
float planted_gain(int number) {
  return 0.7f + 0.7f * static_cast<float>(number * 7 % kViews) / static_cast<float>(kViews - 1);
}

// Photos that are opaque, or cut out as they were; those for training have gains when `planted`.
Dataset capture(const fs::path& data, const fs::path& photos, bool planted, bool cut_out = false) {
  Dataset dataset = load_dataset(data);
  dataset.alpha_is_background = cut_out;
  const float grey[3] = {0.4f, 0.45f, 0.5f};
  int number = 0;
  for (View& view : dataset.views) {
    Image photo = load_view_image(view);
    if (!cut_out) photo = composite(photo, grey);
    const float gain = planted && !view.test ? planted_gain(number) : 1.0f;
    for (std::size_t i = 0; i < photo.data.size(); ++i) {
      if (photo.channels == 3 || i % 4 != 3) photo.data[i] *= 0.65f * gain;
    }
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

nlohmann::json exposures_of(const fs::path& run) {
  std::ifstream stream(run / "exposures.json");
  return nlohmann::json::parse(stream);
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
  const nlohmann::json exposures = exposures_of(folder.path() / "modelled");
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

TEST_CASE("planted gains of cut-out photos are found, whatever lies behind these") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, kSize, kViews, 5);
  const Dataset gains = capture(data, folder.path() / "gains", true, true);
  for (const std::string background : {"1,1,1", "random"}) {
    CAPTURE(background);
    TrainOptions options = options_of(true);
    options.background = background;
    fs::remove_all(run);
    Trainer(context, gains, options, run).run(false);
    const nlohmann::json exposures = exposures_of(run);
    REQUIRE(exposures.size() == kViews);
    // The slope of what a grey becomes over the true gains, whose mean is 1.05, not 1.
    double slope = 0, squares = 0;
    int number = 0;
    for (const View& view : gains.views) {
      const int own = number++;
      if (view.test) continue;
      const nlohmann::json& row = exposures.at(view.camera.name).at(1);
      double shown = row[3].get<double>() / kGrey;
      for (std::size_t k = 0; k < 3; ++k) shown += row[k].get<double>();
      const double gain = static_cast<double>(planted_gain(own)) / 1.05 - 1;
      slope += gain * (shown - 1);
      squares += gain * gain;
    }
    slope /= squares;
    MESSAGE("over " << background << " the gains found are " << slope << " of the planted ones");
    CHECK(slope > 0.8);
    CHECK(slope < 1.2);
  }
}

TEST_CASE("photos that judge a run have no part in the mean colour before they join") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, 24, 8, 2);
  const Dataset gains = capture(data, folder.path() / "gains", true);
  TrainOptions options = options_of(true);
  options.iterations = 40;
  options.max_gaussians = 600;
  options.validate_views = 3;
  const auto mean_of = [](const nlohmann::json& exposures, std::size_t* untouched) {
    const nlohmann::json identity{{1.0, 0.0, 0.0, 0.0}, {0.0, 1.0, 0.0, 0.0}, {0.0, 0.0, 1.0, 0.0}};
    double sum = 0;
    *untouched = 0;
    for (const auto& rows : exposures) {
      if (rows == identity) {
        ++*untouched;
        continue;
      }
      sum += rows[1][1].get<double>();
    }
    return sum / static_cast<double>(exposures.size() - *untouched);
  };
  Trainer trainer(context, gains, options, run);
  trainer.step(36);  // nine tenths
  trainer.save();
  std::size_t untouched = 0;
  CHECK(mean_of(exposures_of(run), &untouched) == doctest::Approx(1.0).epsilon(1e-6));
  CHECK(untouched == 3);
  trainer.run(false);
  CHECK(mean_of(exposures_of(run), &untouched) == doctest::Approx(1.0).epsilon(1e-6));
  CHECK(untouched < 3);
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
