// SPDX-License-Identifier: Apache-2.0
#include "train/crowded_places.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "scene/camera/camera_model.hpp"
#include "train/schedule.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

/// A ring of cameras 5 away from what they see.
std::vector<Camera> ring(int count) {
  std::vector<Camera> out;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * std::numbers::pi * i / count;
    out.push_back(
        look_at({5 * std::cos(angle), 5 * std::sin(angle), 1}, {0, 0, 1}, {0, 0, 1}, 40, 30, 40));
  }
  return out;
}

CrowdedPlaces crowded(const std::vector<Camera>& cameras) {
  return crowded_places(cameras, std::vector<double>(cameras.size(), 5.0));
}

}  // namespace

TEST_CASE("photos of one place are those of a camera that hardly moves or turns") {
  const Camera one = ring(1).front();
  CHECK(from_one_place(one, moved(one, {0, 0.04, 0}, {0, 0.04, 0}), 5));
  CHECK_FALSE(from_one_place(one, moved(one, {0, 0.06, 0}, {0, 0, 0}), 5));
  CHECK_FALSE(from_one_place(one, moved(one, {0, 0, 0}, {0, 0.06, 0}), 5));
  // Turned about its own axis it sees the same.
  CHECK(from_one_place(one, moved(one, {0, 0, 1}, {0, 0, 0}), 5));
  Camera around = one;
  set_equirectangular(around);
  CHECK_FALSE(from_one_place(one, around, 5));
  CHECK(from_one_place(around, moved(around, {0, 1, 0}, {0, 0, 0}), 5));
}

TEST_CASE("a place where a camera stands still is crowded, and no other") {
  std::vector<Camera> cameras = ring(40);
  CHECK(crowded(cameras).places.empty());
  CounterRng rng(1, 1);
  std::vector<std::size_t> still{7};
  const auto stand = [&](int count) {
    for (int i = 0; i < count; ++i) {
      still.push_back(cameras.size());
      cameras.push_back(moved(cameras[7], {0.01 * rng.uniform(), 0.01 * rng.uniform(), 0},
                              {0.02 * rng.uniform(), 0, 0.02 * rng.uniform()}));
    }
  };
  stand(3);
  CHECK(crowded(cameras).places.empty());  // four are not many
  stand(20);
  const CrowdedPlaces found = crowded(cameras);
  CHECK(found.most == 4);
  REQUIRE(found.places.size() == 1);
  CHECK(found.places.front().photos == still);
  CHECK(found.places.front().distance == 5);
  // Where every place has as many, none has more than others.
  std::vector<Camera> slow;
  for (const Camera& camera : ring(10)) slow.insert(slow.end(), 24, camera);
  CHECK(crowded(slow).places.empty());
  CHECK(crowded({}).places.empty());
}

TEST_CASE("a pass draws as many photos of a crowded place as it is worth, others each time") {
  CrowdedPlaces crowd{{{}}, 4};
  for (std::size_t i = 10; i < 30; ++i) crowd.places.front().photos.push_back(i);
  ViewOrder order(1, 30, {}, 0, crowd);
  std::vector<int> seen(30);
  constexpr int kPasses = 50, kPass = 14;
  for (int pass = 0; pass < kPasses; ++pass) {
    std::vector<int> here(30);
    for (int i = 0; i < kPass; ++i) ++here[order.at(pass * kPass + i)];
    int still = 0;
    for (std::size_t view = 0; view < 30; ++view) {
      CHECK(here[view] <= 1);
      if (view < 10) CHECK(here[view] == 1);
      if (view >= 10) still += here[view];
      seen[view] += here[view];
    }
    CHECK(still == 4);
  }
  for (std::size_t view = 10; view < 30; ++view) {
    CHECK(seen[view] > 2);  // 10 in the mean
    CHECK(seen[view] < 22);
  }
  // A new object that begins anywhere, and one that leaves most of them out.
  ViewOrder resumed(1, 30, {}, 0, crowd);
  CHECK(resumed.at(100) == order.at(100));
  std::vector<std::size_t> odd;
  for (std::size_t i = 5; i < 27; ++i) odd.push_back(i);
  order.leave_out(odd, 700);
  std::vector<int> late(30);
  for (int i = 0; i < 8; ++i) ++late[order.at(700 + i)];
  for (std::size_t view = 0; view < 30; ++view)
    CHECK(late[view] == (view < 5 || view >= 27 ? 1 : 0));
}

TEST_CASE("a run on photos of a camera that stands still says so, and again when it is resumed") {
  std::vector<Camera> cameras = ring(20);
  cameras.insert(cameras.end(), 20, cameras[3]);  // four of them held out
  const Photographed data(coloured_cloud(50, 1.0, 8), cameras);
  TrainOptions options = short_training(6);
  options.init = "random";
  options.checkpoint_every = 3;
  const auto warnings_of = [](const std::filesystem::path& run) {
    return nlohmann::json::parse(std::ifstream(run / "metrics.json")).at("camera_warnings");
  };
  const LogCapture log;
  {
    Trainer trainer(shared_test_context(), data.dataset, options, data.folder / "run");
    CHECK(trainer.step(1));  // which starts the run, as run() does
    trainer.run(false);
  }
  const nlohmann::json told = warnings_of(data.folder / "run");
  REQUIRE(told.size() == 1);
  CHECK(told.front().get<std::string>().starts_with(
      "17 of 32 training photos are from 1 place, as where a video stands still"));
  CHECK(told.front().get<std::string>().find("; 4 of 8 held-out photos are from there too") !=
        std::string::npos);
  CHECK(log.contains(told.front().get<std::string>()));
  Trainer resumed(shared_test_context(), data.dataset, options, data.folder / "run", true);
  resumed.resume(checkpoint_path(data.folder / "run", 3));
  resumed.run(false);
  CHECK(warnings_of(data.folder / "run") == told);
  options.even_places = false;
  Trainer(shared_test_context(), data.dataset, options, data.folder / "all").run(false);
  CHECK(warnings_of(data.folder / "all").empty());
}
