// SPDX-License-Identifier: Apache-2.0
// Runs on photos in which something moves.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/same_run.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kPhotos = 30;
constexpr int kSize = 48;
constexpr int kBox = 16;  // pixels of a side

/// Photos all around, before which a box goes in all that are trained on.
struct Crowded : Photographed {
  explicit Crowded(bool boxes = true)
      : Photographed(coloured_cloud(400, 1.0, 8), ring_around_cloud(kPhotos, kSize)) {
    CounterRng rng(5, 2);
    for (const float position : coloured_cloud(400, 1.0, 8).means) {
      dataset.points.positions.push_back(position + static_cast<float>(0.05 * rng.normal()));
      dataset.points.colors.push_back(0.5f);
    }
    if (!boxes) return;
    for (const View& view : dataset.views) {
      const int left = static_cast<int>(rng.below(kSize - kBox)),
                top = static_cast<int>(rng.below(kSize - kBox));
      if (view.test) continue;
      Image photo = read_image(view.image_path);
      for (int y = top; y < top + kBox; ++y) {
        for (int x = left; x < left + kBox; ++x) {
          for (int c = 0; c < 3; ++c) photo.at(x, y, c) = c == 1 ? 0.9f : 0.1f;
        }
      }
      write_image(view.image_path, photo);
    }
  }
};

TrainOptions leaving_out(int iterations) {
  TrainOptions options = short_training(iterations);
  options.init = "colmap";
  options.max_gaussians = 2000;
  options.leave_out_moving = true;
  options.leave_out_odd = false;
  return options;
}

/// The share of the photos that a run says it has left out.
double share_left_out(const std::filesystem::path& run) {
  double sum = 0;
  const auto metrics = nlohmann::json::parse(std::ifstream(run / "metrics.json"));
  for (const nlohmann::json& photo : metrics.at("photos")) sum += photo.value("moving", 0.0);
  return sum / static_cast<double>(metrics.at("photos").size());
}

/// How many photos' worth of pixels is black in the masks of a folder.
double black_photos(const std::filesystem::path& folder) {
  double sum = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const Image mask = read_image(entry.path());
    for (int y = 0; y < mask.height; ++y) {
      for (int x = 0; x < mask.width; ++x) sum += mask.at(x, y, 0) < 0.5f ? 1.0 : 0.0;
    }
  }
  return sum / (kSize * kSize);
}

}  // namespace

TEST_CASE("what moves in the photos is left out of a run, which gains by it") {
  const Crowded data;
  const auto trained = [&](bool leaves_out) {
    TrainOptions options = leaving_out(900);
    options.leave_out_moving = leaves_out;
    const std::filesystem::path run = data.folder / (leaves_out ? "without" : "with");
    Trainer trainer(shared_test_context(), data.dataset, options, run);
    const double psnr = trainer.run(false).evaluations.back().psnr;
    const double share = share_left_out(run);
    constexpr double kBoxes = static_cast<double>(kBox * kBox) / (kSize * kSize);
    if (leaves_out) {
      MESSAGE(share << " of " << kBoxes << " left out");
      CHECK(share > 0.6 * kBoxes);
      CHECK(share < 1.8 * kBoxes);
      const auto photos = static_cast<double>(data.dataset.indices(Split::kTrain).size());
      CHECK(black_photos(run / "moving") == doctest::Approx(photos * share).epsilon(1e-6));
    } else {
      CHECK(!std::filesystem::exists(run / "moving"));
      CHECK(share == 0);
    }
    return psnr;
  };
  const double with = trained(false), without = trained(true);
  MESSAGE("with what moves " << with << " dB, without " << without << " dB");
  CHECK(without > with + 1);
}

TEST_CASE("photos in which nothing moves are trained on whole, but for little") {
  const Crowded data(false);
  const TrainOptions options = leaving_out(600);
  Trainer(shared_test_context(), data.dataset, options, data.folder / "run").run(false);
  CHECK(share_left_out(data.folder / "run") < 0.01);
}

TEST_CASE("a run that is resumed leaves out what it would have, bit for bit") {
  const Crowded data;
  TrainOptions options = leaving_out(400);
  const Gaussians straight = check_resumed(data, options, {60, 80, 140, 300}, share_left_out);
  CHECK(share_left_out(data.folder / "straight") > 0);
  // Told to train on it from here on, it does.
  options.leave_out_moving = false;
  options.checkpoint_every = 100;
  Trainer kept(shared_test_context(), data.dataset, options, data.folder / "kept");
  kept.resume(checkpoint_path(data.folder / "straight", 300));
  kept.run(false);
  CHECK(share_left_out(data.folder / "kept") == 0);
  CHECK(straight.means != kept.model().means);
  // Told to leave it out when it is no longer looked for, it says so.
  options.leave_out_moving = true;
  options.iterations = 420;
  Trainer late(shared_test_context(), data.dataset, options, data.folder / "late");
  late.resume(checkpoint_path(data.folder / "kept", 400));
  const LogCapture log;
  late.run(false);
  CHECK(log.contains("leave-out-moving comes too late"));
}

TEST_CASE("ranks leave out the same as one does, and train the same model") {
  const Crowded data;
  check_ranks(data, leaving_out(200), share_left_out);
  CHECK(share_left_out(data.folder / "alone") > 0);
}

TEST_CASE("checkpoints that leave out parts of other photos are refused") {
  const Crowded data;
  TrainOptions options = leaving_out(60);
  options.checkpoint_every = 40;
  Trainer(shared_test_context(), data.dataset, options, data.folder / "run").run(false);
  Checkpoint checkpoint = read_checkpoint(checkpoint_path(data.folder / "run", 40));
  REQUIRE(checkpoint.sections.contains("moving"));
  const auto damaged = [&](auto&& damage) {
    Checkpoint other = checkpoint;
    damage(other.sections.at("moving"));
    write_checkpoint(data.folder / "damaged.rsck", other);
    Trainer trainer(shared_test_context(), data.dataset, options, data.folder / "resumed", true);
    CHECK_THROWS_AS(trainer.resume(data.folder / "damaged.rsck"), DataError);
  };
  damaged([](std::vector<float>& numbers) { numbers.pop_back(); });
  damaged([](std::vector<float>& numbers) { numbers.front() = -1; });
  damaged([](std::vector<float>& numbers) { numbers.front() = 1e9f; });
  damaged([](std::vector<float>& numbers) { numbers.insert(numbers.begin(), {9.0f, 0.0f}); });
  damaged([](std::vector<float>& numbers) { numbers.push_back(1); });
}
