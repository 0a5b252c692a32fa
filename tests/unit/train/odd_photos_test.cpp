// SPDX-License-Identifier: Apache-2.0
// Runs on photos of which some have wrong poses.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <glm/vec3.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <set>
#include <string>
#include <vector>

#include "comm/thread_ranks.hpp"
#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kPhotos = 50;
const std::set<std::string> kWrong{"view_11.png", "view_23.png", "view_38.png"};

std::vector<Camera> ring() {
  std::vector<Camera> out;
  for (int i = 0; i < kPhotos; ++i) {
    const double angle = 2 * std::numbers::pi * i / kPhotos;
    out.push_back(look_at({4 * std::cos(angle), 4 * std::sin(angle), i % 2}, {0, 0, 0}, {0, 0, 1},
                          40, 40, 44));
  }
  return out;
}

/// Photos all around, three of which are said to have been taken elsewhere.
struct Misplaced : Photographed {
  Misplaced() : Photographed(coloured_cloud(400, 1.0, 8), ring()) {
    const std::vector<Camera> cameras = ring();
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
  TrainOptions options = from_points(800);
  options.trace.deterministic = true;
  options.checkpoint_every = 20;
  options.keep_checkpoints = 99;
  Trainer straight(shared_test_context(), data.dataset, options, data.folder / "straight");
  straight.run(false);
  for (const int from : {100, 160, 200, 400}) {
    INFO(from);
    const std::filesystem::path run = data.folder / std::to_string(from);
    Trainer resumed(shared_test_context(), data.dataset, options, run);
    resumed.resume(checkpoint_path(data.folder / "straight", from));
    resumed.run(false);
    CHECK(left_out_of(run) == kWrong);
    check_equal(straight.model(), resumed.model());
  }
}

TEST_CASE("ranks leave out the same photos as one does, and train the same model") {
  const Misplaced data;
  TrainOptions options = from_points(400);
  options.trace.deterministic = true;
  options.views_per_step = 2;
  Context first(test_device()), second(test_device());
  const std::array<Context*, 2> contexts{&first, &second};
  Trainer alone(first, data.dataset, options, data.folder / "alone");
  alone.run(false);
  CHECK(left_out_of(data.folder / "alone") == kWrong);
  std::array<Gaussians, 2> models;
  run_thread_ranks(2, [&](Communicator& ranks) {
    const auto rank = static_cast<std::size_t>(ranks.rank());
    Trainer trainer(*contexts[rank], data.dataset, options, data.folder / std::to_string(rank),
                    false, &ranks);
    trainer.run(false);
    models[rank] = trainer.model();
  });
  CHECK(left_out_of(data.folder / "0") == kWrong);
  for (const Gaussians& model : models) check_equal(alone.model(), model);
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
