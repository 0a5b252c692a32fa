// SPDX-License-Identifier: Apache-2.0
// Every kind of capture trains with the default settings: what breaks one of them fails here.
#include <doctest/doctest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/trainer.hpp"
#include "synth/synthetic_dataset.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

struct Folder {
  fs::path path =
      fs::temp_directory_path() / ("raysplats_capture_kinds_" + std::to_string(::getpid()));
  Folder() { fs::remove_all(path); }
  ~Folder() {
    std::error_code error;
    fs::remove_all(path, error);
  }
};

struct Kind {
  std::string name;
  SyntheticScene scene;
  double floor;  // decibels, about one below what the defaults reach
};

}  // namespace

TEST_CASE("every kind of capture reaches its floor with the defaults") {
  const Folder folder;
  Context context{select_device("")};
  for (const Kind& kind :
       {Kind{"still-life", SyntheticScene::kStillLife, 29.5},
        Kind{"forward", SyntheticScene::kForward, 33.0}, Kind{"room", SyntheticScene::kRoom, 26.5},
        Kind{"outdoor", SyntheticScene::kOutdoor, 25.0}}) {
    CAPTURE(kind.name);
    SyntheticOptions synthetic;
    synthetic.scene = kind.scene;
    synthetic.size = 64;
    synthetic.train_views = 28;
    synthetic.test_views = 6;
    const fs::path data = folder.path / kind.name;
    generate_dataset(data, synthetic);
    const Dataset dataset = load_dataset(data);
    CHECK(dataset.indices(Split::kTrain).size() == 28);
    CHECK(dataset.indices(Split::kTest).size() == 6);
    CHECK(dataset.alpha_is_background == (kind.scene == SyntheticScene::kStillLife));
    TrainOptions options;
    options.iterations = 500;
    options.eval_renders = 0;
    options.checkpoint_every = 0;
    Trainer trainer(context, dataset, options, folder.path / ("run_" + kind.name));
    const std::vector<EvaluationRow> rows = trainer.run(false).evaluations;
    MESSAGE(kind.name << " " << rows.back().psnr << " dB, " << rows.back().gaussians
                      << " Gaussians");
    CHECK(rows.back().psnr > kind.floor);
    for (const EvaluationRow& row : rows) CHECK(row.psnr < rows.back().psnr + 0.1);
  }
}
