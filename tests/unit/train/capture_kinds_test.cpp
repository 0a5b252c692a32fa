// SPDX-License-Identifier: Apache-2.0
// Every kind of capture trains with the default settings: what breaks one of them fails here.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
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
