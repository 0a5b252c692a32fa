// SPDX-License-Identifier: Apache-2.0
// A background that is trained by direction: its steps, its worth outdoors, its files.
#include <doctest/doctest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model.hpp"
#include "raysplats/tracer.hpp"
#include "raysplats/trainer.hpp"
#include "run/model_source.hpp"
#include "run/train_config.hpp"
#include "train/optimizer/sky_adam.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

TrainOptions under_sky(int iterations) {
  TrainOptions options = short_training(iterations);
  options.background = "sky";
  return options;
}

struct Trained {
  double psnr;
  Gaussians model;
};

Trained trained(Context& context,
                const Dataset& dataset,
                const TrainOptions& options,
                const fs::path& run) {
  Trainer trainer(context, dataset, options, run);
  const double psnr = trainer.run(false).evaluations.back().psnr;
  return {psnr, trainer.model()};
}

}  // namespace

TEST_CASE(
    "steps of a sky are Adam's in double precision, and none where the guard says so [small]") {
  Context context{test_device()};
  constexpr std::size_t kNumbers = 12;
  SkyAdam adam(context, kNumbers);
  Buffer<float> gradient(context, kNumbers, "gradient"), sky(context, kNumbers, "sky");
  Buffer<std::uint32_t> guard(context, 1, "guard");
  sky.clear();
  std::vector<double> expected(kNumbers), first(kNumbers), second(kNumbers);
  for (int step = 1; step <= 20; ++step) {
    std::vector<float> slope(kNumbers);
    for (std::size_t k = 0; k < kNumbers; ++k)
      slope[k] = static_cast<float>(std::sin(1.0 + static_cast<double>(k) + 0.7 * step));
    gradient.upload(slope);
    guard.upload(std::vector<std::uint32_t>{1});
    adam.step(gradient, sky, 0.02, guard);
    guard.upload(std::vector<std::uint32_t>{0});
    adam.step(gradient, sky, 0.02, guard);
    for (std::size_t k = 0; k < kNumbers; ++k) {
      const auto g = static_cast<double>(slope[k]);
      first[k] = 0.9 * first[k] + 0.1 * g;
      second[k] = 0.999 * second[k] + 0.001 * g * g;
      expected[k] -= 0.02 * first[k] / (1 - std::pow(0.9, step)) /
                     std::sqrt(second[k] / (1 - std::pow(0.999, step)));
    }
  }
  const std::vector<float> got = sky.download();
  for (std::size_t k = 0; k < kNumbers; ++k)
    CHECK(got[k] == doctest::Approx(expected[k]).epsilon(1e-4));
  CHECK_THROWS_AS(adam.restore({{0}, {0}, {0}}), DataError);
}

namespace {

struct Outdoors {
  TemporaryDirectory folder;
  Context context{test_device()};
  Dataset dataset;
  TrainOptions options = short_training(200);

  Outdoors() {
    make_photos(folder.path() / "data", 40, 12, 3, SyntheticScene::kOutdoor);
    dataset = load_dataset(folder.path() / "data");
    options.max_gaussians = 300;  // more of them show most of the sky themselves
    // Elsewhere than on CPUs gradients are atomic sums otherwise.
    options.trace.deterministic = true;
  }
};

}  // namespace

TEST_CASE("a sky pays outdoors") {
  Outdoors scene;
  // Single runs differ by more than a sky is worth.
  constexpr std::uint64_t kSeeds = 6;
  double gain = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    scene.options.seed = seed;
    const auto psnr = [&](const char* background) {
      scene.options.background = background;
      const auto run = scene.folder.path() / (background + std::to_string(seed));
      return trained(scene.context, scene.dataset, scene.options, run).psnr;
    };
    gain += (psnr("sky") - psnr("auto")) / kSeeds;
  }
  MESSAGE("a sky is worth " << gain << " dB");
  CHECK(gain > 0.05);
}

TEST_CASE("a run with a sky can be looked at, moved and resumed bit for bit") {
  Outdoors scene;
  auto& [folder, context, dataset, options] = scene;
  options.background = "sky";
  const Trained sky = trained(context, dataset, options, folder.path() / "sky");
  const double with = sky.psnr;

  // What the run's files say is what the run showed.
  const ModelSource source = find_model(folder.path() / "sky");
  const TraceOptions shown = trace_options(source);
  CHECK(shown.sky.size() == 9);
  Tracer tracer(context, shown);
  const Model model(context, read_model(source.file));
  const EvaluationReport report =
      evaluate([&](const Camera& camera) { return tracer.render(model, camera); }, dataset,
               Split::kTest, shown.background, {}, {});
  CHECK(report.mean.psnr == doctest::Approx(with).epsilon(1e-5));
  // A copy elsewhere has it in its header.
  fs::copy_file(source.file, folder.path() / "copy.ply");
  CHECK(trace_options(find_model(folder.path() / "copy.ply")).sky == shown.sky);

  options.checkpoint_every = 71;
  Trainer part(context, dataset, options, folder.path() / "part");
  part.step(71);
  part.save();
  Trainer rest(context, dataset, options, folder.path() / "rest");
  rest.resume(folder.path() / "part");
  rest.run(false);
  check_equal(rest.model(), sky.model);
  CHECK(trace_options(find_model(folder.path() / "rest")).sky == shown.sky);
  options.sky_degree = 1;
  Trainer other(context, dataset, options, folder.path() / "other");
  CHECK_THROWS_AS(other.resume(folder.path() / "part"), UsageError);
}

TEST_CASE("options that exclude a sky are refused") {
  TrainOptions options = under_sky(10);
  CHECK_NOTHROW(validate(options));
  options.poses = true;
  CHECK_THROWS_AS(validate(options), UsageError);
  options.poses = false;
  options.mirrors = {"/mirror.obj"};
  CHECK_THROWS_AS(validate(options), UsageError);
  const TemporaryDirectory folder;
  Context context{test_device()};
  make_photos(folder.path() / "data", 16, 3, 1);
  CHECK_THROWS_AS(
      Trainer(context, load_dataset(folder.path() / "data"), under_sky(10), folder.path() / "run"),
      UsageError);
}
