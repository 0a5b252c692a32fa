// SPDX-License-Identifier: Apache-2.0
// Photos with something in them that the others do not show, and masks that say where.
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

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
constexpr int kBox = 22;  // pixels of a side

// Paints a box into three of ten photos, at another place in each, and puts masks of it beside
// them.
void add_moving_box(const fs::path& data) {
  fs::create_directories(data / "masks/train");
  for (int i = 0; i < kViews; ++i) {
    if (i % 10 >= 3) continue;
    const std::string name = "train/r_" + std::to_string(i) + ".png";
    Image photo = read_image(data / name);
    Image mask(kSize, kSize, 1, 1.0f);
    const int left = (7 * i) % (kSize - kBox), top = (5 * i + 3) % (kSize - kBox);
    for (int y = top; y < top + kBox; ++y) {
      for (int x = left; x < left + kBox; ++x) {
        photo.at(x, y, 0) = 0.9f;
        photo.at(x, y, 1) = 0.1f;
        photo.at(x, y, 2) = 0.8f;
        photo.at(x, y, 3) = 1.0f;
        mask.at(x, y, 0) = 0.0f;
      }
    }
    write_image(data / name, photo);
    write_image(data / "masks" / name, mask);
  }
}

void add_black_mask(const fs::path& data, const std::string& name) {
  fs::create_directories((data / "masks" / name).parent_path());
  write_image(data / "masks" / name, Image(kSize, kSize, 1, 0.0f));
}

double trained_psnr(Context& context, const fs::path& data, const fs::path& run) {
  Trainer trainer(context, load_dataset(data), short_training(500), run);
  return trainer.run(false).evaluations.back().psnr;
}

}  // namespace

TEST_CASE("a moving box under masks costs next to nothing, and much without them") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kViews, 5);
  const double clean = trained_psnr(context, data, folder.path() / "clean");
  add_moving_box(data);
  const double masked = trained_psnr(context, data, folder.path() / "masked");
  fs::rename(data / "masks", folder.path() / "masks");
  const double bare = trained_psnr(context, data, folder.path() / "bare");
  MESSAGE("clean " << clean << " dB, masked " << masked << ", without masks " << bare);
  CHECK(masked > clean - 0.3);
  CHECK(bare < clean - 0.5);
}

TEST_CASE("a run leaves out photos whose masks ignore all of them, as if they were not there") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, 6, 3);
  Dataset without = load_dataset(data);
  std::erase_if(without.views, [](const View& view) {
    return view.camera.name == "train/r_2.png" || view.camera.name == "test/r_1.png";
  });
  REQUIRE(without.views.size() == 7);
  add_black_mask(data, "train/r_2.png");
  add_black_mask(data, "test/r_1.png");
  TrainOptions options = short_training(12);
  options.eval_every = 6;
  const auto trained = [&](Dataset dataset, const char* name) {
    Trainer trainer(context, std::move(dataset), options, folder.path() / name);
    const EvaluationRow last = trainer.run(false).evaluations.back();
    return std::pair(last, trainer.model());
  };
  const auto [expected, expected_model] = trained(without, "without");
  const auto [row, model] = trained(load_dataset(data), "masked");
  CHECK(row.views == 2);
  CHECK(std::isfinite(row.psnr));
  CHECK(row.psnr == expected.psnr);
  CHECK(model.size() > 0);
  check_equal(model, expected_model);
}

TEST_CASE("a start without a Gaussian because masks leave nothing of the photos names the masks") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data", mask = folder.path() / "dark.png";
  make_photos(data, kSize, 6, 1);
  write_image(mask, Image(kSize, kSize, 1, 0.3f));  // less than half of every pixel
  Dataset dataset = load_dataset(data);
  dataset.alpha_is_background = false;
  dataset.points = {};
  for (View& view : dataset.views) view.mask_path = mask;
  Trainer trainer(context, dataset, short_training(10), folder.path() / "run");
  std::string message;
  try {
    trainer.run(false);
  } catch (const UsageError& error) {
    message = error.what();
  }
  CHECK(message.find("masks, areas or transparent pixels leave 0 % of the photos") !=
        std::string::npos);
}
