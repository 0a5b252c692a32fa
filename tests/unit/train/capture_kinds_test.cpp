// SPDX-License-Identifier: Apache-2.0
// Every kind of capture trains with the default settings: what breaks one of them fails here.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

struct Kind {
  std::string name;
  SyntheticScene scene;
  double floor;  // decibels, about one below what the defaults reach
};

constexpr float kFog = 0.05f;  // what it leaves of a photo's contrast

void fog_photos(const fs::path& folder) {
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.path().extension() != ".png") continue;
    Image photo = read_image(entry.path());
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        for (int c = 0; c < 3; ++c) photo.at(x, y, c) = 0.6f + kFog * (photo.at(x, y, c) - 0.5f);
      }
    }
    write_image(entry.path(), photo);
  }
}

}  // namespace

TEST_CASE("every kind of capture reaches its floor with the defaults") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  for (const Kind& kind :
       {Kind{"still-life", SyntheticScene::kStillLife, 29.5},
        Kind{"forward", SyntheticScene::kForward, 33.0}, Kind{"room", SyntheticScene::kRoom, 26.5},
        Kind{"outdoor", SyntheticScene::kOutdoor, 25.0}}) {
    CAPTURE(kind.name);
    const fs::path data = folder.path() / kind.name;
    make_photos(data, 64, 28, 6, kind.scene);
    const Dataset dataset = load_dataset(data);
    CHECK(dataset.indices(Split::kTrain).size() == 28);
    CHECK(dataset.indices(Split::kTest).size() == 6);
    CHECK(dataset.alpha_is_background == (kind.scene == SyntheticScene::kStillLife));
    TrainOptions options;
    options.iterations = 500;
    options.eval_renders = 0;
    options.checkpoint_every = 0;
    Trainer trainer(context, dataset, options, folder.path() / ("run_" + kind.name));
    const std::vector<EvaluationRow> rows = trainer.run(false).evaluations;
    MESSAGE(kind.name << " " << rows.back().psnr << " dB, " << rows.back().gaussians
                      << " Gaussians");
    CHECK(rows.back().psnr > kind.floor);
    for (const EvaluationRow& row : rows) CHECK(row.psnr < rows.back().psnr + 0.1);
  }
}

TEST_CASE("a scene in fog is the same scene in smaller numbers") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, 48, 20, 5, SyntheticScene::kForward);
  const auto trained = [&](const char* run, double range) {
    TrainOptions options = short_training(400);
    options.color_range = range;
    Trainer trainer(context, load_dataset(data), options, folder.path() / run);
    return trainer.run(false).evaluations.back().psnr;
  };
  const double clear = trained("clear", 0);
  fog_photos(data);
  const double fog = trained("fog", 0), as_if_clear = trained("as_if_clear", 1);
  const double whole = -20 * std::log10(static_cast<double>(kFog));  // nothing lost but contrast
  MESSAGE("clear " << clear << " dB, fog " << fog << ", with the rates of clear photos "
                   << as_if_clear);
  // The steps of 8 bits and the constants of SSIM do not shrink with the colours.
  CHECK(fog > clear + whole - 4);
  CHECK(fog > as_if_clear + 1);
}
