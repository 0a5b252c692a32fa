// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "view/run_history.hpp"
#include "view/time_share.hpp"
#include "view/view_state.hpp"

using namespace raysplats;
using namespace raysplats::view;

namespace {

constexpr double kStep = 0.01;

/// The share of a minute that pictures take which need `picture` seconds each, drawn whenever they
/// may be between steps of 10 ms.
double share_of_minute(TimeShare time, double picture, double since_motion) {
  double drawn = 0;
  double last = 0;
  for (double now = 0; now < 60;) {
    now += kStep;
    time.pass(now - last, since_motion);
    last = now;
    if (!time.free()) continue;
    time.spend(picture);
    drawn += picture;
    now += picture;
  }
  return drawn / 60;
}

}  // namespace

TEST_CASE("pictures take their share of the time, half of it while somebody moves, and none at 0") {
  constexpr double kLongAgo = 1e9;
  for (const double picture : {0.01, 0.05, 0.4}) {
    CAPTURE(picture);
    TimeShare time;
    CHECK(share_of_minute(time, picture, kLongAgo) == doctest::Approx(0.1).epsilon(0.1));
    time.set_share(0.3);
    CHECK(share_of_minute(time, picture, kLongAgo) == doctest::Approx(0.3).epsilon(0.1));
    time.set_share(0);
    CHECK(share_of_minute(time, picture, 0.1) == 0);
  }
  CHECK(share_of_minute(TimeShare(), 0.05, 0.1) == doctest::Approx(0.5).epsilon(0.05));
  CHECK(share_of_minute(TimeShare(), 0.05, 2.5) == doctest::Approx(0.1).epsilon(0.1));
}

TEST_CASE("what a page is told of a run does not grow with it, and ends with the newest row") {
  RunHistory history(100000);
  history.add(TrainRow{10, 0.1, 0.5, 11.0, 1000, 100.0});
  nlohmann::json json = nlohmann::json::parse(history.json());
  CHECK(json["rows"] == nlohmann::json{{10, 0.1, 0.5, 11.0, 1000}});
  CHECK(json["left"] == doctest::Approx(999.9));
  CHECK(json["ended"] == "");
  history.set_iterations(20000);
  json = nlohmann::json::parse(history.json());
  CHECK(json["iterations"] == 20000);
  CHECK(json["left"] == doctest::Approx(199.9));
  history.set_iterations(100000);
  for (int i = 2; i <= 9999; ++i) history.add(TrainRow{10 * i, 0.1 * i, 0.4, 12.0, 2000, 50.0});
  EvaluationRow test;
  test.iteration = 5000;
  test.psnr = 23.5;
  history.add(test);
  history.set_state(true, 0.25);
  history.finish("over \xff");
  json = nlohmann::json::parse(history.json());
  CHECK(json["rows"].size() <= 1025);
  CHECK(json["rows"].size() > 500);
  CHECK(json["rows"].front()[0] == 10);
  CHECK(json["rows"].back()[0] == 99990);
  int before = 0;
  for (const auto& row : json["rows"]) {
    CHECK(row[0] > before);
    before = row[0];
  }
  CHECK(json["tests"] == nlohmann::json{{5000, 23.5}});
  CHECK(json["paused"] == true);
  CHECK(json["share"] == 0.25);
  CHECK(json["ended"].get<std::string>().starts_with("over"));
}

TEST_CASE("what is not finite is no row of a run's curves") {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  RunHistory history(100);
  history.add(TrainRow{10, 0.1, 0.5, 11.0, 1000, 100.0});
  history.add(TrainRow{20, 0.2, kNan, 11.0, 1000, 100.0});
  history.add(TrainRow{30, 0.3, 0.5, kNan, 1000, 100.0});
  EvaluationRow test;
  test.psnr = kNan;
  history.add(test);
  const nlohmann::json json = nlohmann::json::parse(history.json());
  CHECK(json["rows"] == nlohmann::json{{10, 0.1, 0.5, 11.0, 1000}});
  CHECK(json["tests"].empty());
}

TEST_CASE("before there is a model the page looks at what the cameras look at") {
  std::vector<Camera> cameras;
  for (const glm::dvec3 eye : {glm::dvec3(4, 0, 1), glm::dvec3(-4, 0, 1), glm::dvec3(0, 4, 1)})
    cameras.push_back(look_at(eye, {0, 0, 1}, {0, 0, 1}, 40, 30, 40));
  const SceneExtent extent = extent_before(cameras);
  CHECK(glm::distance(extent.center, glm::dvec3(0, 0, 1)) < 1e-9);
  CHECK(extent.radius == doctest::Approx(4));
  const ViewState state = first_look(extent, cameras, std::nullopt);
  CHECK(glm::distance(state.up, glm::dvec3(0, 0, 1)) < 1e-9);
  CHECK(state.start.center() == cameras.front().center());
  CHECK(extent_before({}).radius == 1);
  const ViewState bare = first_look({}, {}, glm::dvec3(1, 0, 0));
  CHECK(bare.up == glm::dvec3(1, 0, 0));
  CHECK(bare.cameras.empty());
}
