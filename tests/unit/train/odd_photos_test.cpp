// SPDX-License-Identifier: Apache-2.0
// Runs on photos of which some have wrong poses.
#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/same_run.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kPhotos = 50;
const std::set<std::string> kWrong{"view_11.png", "view_23.png", "view_38.png"};

/// Photos all around, three of which are said to have been taken elsewhere.
struct Misplaced : Photographed {
  Misplaced() : Photographed(coloured_cloud(400, 1.0, 8), ring_around_cloud(kPhotos, 40)) {
    const std::vector<Camera> cameras = ring_around_cloud(kPhotos, 40);
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      View& view = dataset.views[i];
      if (!kWrong.contains(view.camera.name)) continue;
      const std::string name = view.camera.name;
      view.camera = cameras[(i + 9) % cameras.size()];
      view.camera.name = name;
      view.source_camera = view.camera;
    }
    CounterRng rng(5, 2);
    for (const float position : coloured_cloud(400, 1.0, 8).means) {
      dataset.points.positions.push_back(position + static_cast<float>(0.05 * rng.normal()));
      dataset.points.colors.push_back(0.5f);
    }
  }
};

TrainOptions from_points(int iterations) {
  TrainOptions options = short_training(iterations);
  options.init = "colmap";
  options.max_gaussians = 2000;
  return options;
}

/// The photos that a run says it has left out.
std::set<std::string> left_out_of(const std::filesystem::path& run) {
  std::set<std::string> out;
  const auto metrics = nlohmann::json::parse(std::ifstream(run / "metrics.json"));
  for (const nlohmann::json& photo : metrics.at("photos"))
    if (photo.contains("left_out_from")) out.insert(photo.at("name").get<std::string>());
  return out;
}

}  // namespace

TEST_CASE("photos with wrong poses are left out of a run, which gains by it") {
  const Misplaced data;
  const auto trained = [&](bool leaves_out) {
    TrainOptions options = from_points(800);
    options.leave_out_odd = leaves_out;
    const std::filesystem::path run = data.folder / (leaves_out ? "without" : "with");
    Trainer trainer(shared_test_context(), data.dataset, options, run);
    const double psnr = trainer.run(false).evaluations.back().psnr;
    CHECK(left_out_of(run) == (leaves_out ? kWrong : std::set<std::string>()));
    return psnr;
  };
  const double with = trained(false), without = trained(true);
  MESSAGE("with them " << with << " dB, without " << without << " dB");
  CHECK(without > with + 0.5);
}

TEST_CASE("a run that is resumed leaves out the photos that it would have, bit for bit") {
  const Misplaced data;
  check_resumed(data, from_points(800), {100, 160, 200, 400}, left_out_of);
  CHECK(left_out_of(data.folder / "straight") == kWrong);
}

TEST_CASE("ranks leave out the same photos as one does, and train the same model") {
  const Misplaced data;
  check_ranks(data, from_points(400), left_out_of);
  CHECK(left_out_of(data.folder / "alone") == kWrong);
}

TEST_CASE("runs that train poses, or are told to, keep all photos") {
  const Misplaced data;
  TrainOptions options = from_points(800);
  options.poses = true;
  Trainer(shared_test_context(), data.dataset, options, data.folder / "poses").run(false);
  CHECK(left_out_of(data.folder / "poses").empty());
  // A checkpoint's photos come back.
  options.poses = false;
  options.checkpoint_every = 600;
  Trainer(shared_test_context(), data.dataset, options, data.folder / "usual").run(false);
  options.leave_out_odd = false;
  Trainer kept(shared_test_context(), data.dataset, options, data.folder / "kept");
  kept.resume(checkpoint_path(data.folder / "usual", 600));
  kept.run(false);
  CHECK(left_out_of(data.folder / "usual") == kWrong);
  CHECK(left_out_of(data.folder / "kept").empty());
}
