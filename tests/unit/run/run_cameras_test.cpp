// SPDX-License-Identifier: Apache-2.0
#include "run/run_cameras.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "io/dataset/camera_list.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/run_folder.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

ModelSource model_of(const fs::path& run) {
  ModelSource source;
  source.file = run / "point_cloud" / "iteration_7" / "point_cloud.ply";
  source.iteration = 7;
  return source;
}

}  // namespace

TEST_CASE("the cameras of a run come with its model") {
  const TemporaryDirectory folder;
  const fs::path run = folder.path() / "run";
  const std::vector<Camera> cameras{look_at({0.1, -2, 5}, {0, 0, 0}, {0, 0, 1}, 320, 200, 250),
                                    look_at({3, 1, 0.5}, {0, 0, 0}, {0, 0, 1}, 64, 48, 50)};
  std::vector<Camera> written = cameras;
  written.push_back(look_at({3, 1, 0.5}, {0, 0, 0}, {0, 0, 1}, 64, 32, 50));
  set_equirectangular(written.back());
  RunFolder(run).write_cameras(written);
  const std::vector<Camera> found = run_cameras(model_of(run));
  REQUIRE(found.size() == 3);
  CHECK(found[1].model == CameraModel::kPinhole);
  CHECK(found[2].model == CameraModel::kEquirectangular);
  // They count as the model does, a transforms.json as the world.
  const glm::dvec3 origin(100, -20, 7);
  const auto center_of = [&](const fs::path& path) {
    return io::read_model_cameras(path, origin).at(0).center();
  };
  CHECK(glm::distance(center_of(run / "cameras.json"), cameras[0].center()) < 1e-9);
  write_cameras(folder.path() / "transforms.json", cameras);
  CHECK(glm::distance(center_of(folder.path() / "transforms.json"), cameras[0].center() - origin) <
        1e-6);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(found[i].width == cameras[i].width);
    CHECK(found[i].height == cameras[i].height);
    CHECK(found[i].fy == doctest::Approx(cameras[i].fy));
    CHECK(found[i].cx == doctest::Approx(cameras[i].cx));
    CHECK(glm::distance(found[i].center(), cameras[i].center()) < 1e-9);
    for (int column = 0; column < 3; ++column)
      CHECK(glm::distance(found[i].rotation[column], cameras[i].rotation[column]) < 1e-9);
  }
}

TEST_CASE("the cameras of a run keep their principal points and lenses") {
  const TemporaryDirectory folder;
  const fs::path run = folder.path() / "run";
  std::vector<Camera> cameras;
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye,
        CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    Camera camera = look_at({0.1, -2, 5}, {0, 0, 0}, {0, 0, 1}, 121, 91, 85);
    camera.name = "a.png";
    camera.model = model;
    camera.fy = 84;
    camera.cx = 30.1;
    camera.cy = 20;
    if (model == CameraModel::kOpenCv) camera.distortion = {0.1, 0.02, 0.003, 0.004, 0.005, 0};
    if (model == CameraModel::kFisheye) camera.distortion = {0.1, 0.02, 0.003, 0, 0, 0.0006};
    if (model == CameraModel::kEquirectangular) set_equirectangular(camera);
    cameras.push_back(camera);
  }
  RunFolder(run).write_cameras(cameras);
  const std::vector<Camera> found = run_cameras(model_of(run));
  REQUIRE(found.size() == cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    CAPTURE(i);
    CHECK(found[i].name == "a.png");
    CHECK(found[i].model == cameras[i].model);
    CHECK(found[i].fx == cameras[i].fx);
    CHECK(found[i].fy == cameras[i].fy);
    CHECK(found[i].cx == cameras[i].cx);
    CHECK(found[i].cy == cameras[i].cy);
    CHECK(found[i].distortion == cameras[i].distortion);
    CHECK(glm::distance(found[i].center(), cameras[i].center()) < 1e-9);
  }
}

TEST_CASE("principal points and lenses of a list that cannot be read are told by one sentence") {
  const TemporaryDirectory folder;
  const fs::path path = folder.path() / "cameras.json";
  const auto entry = [](const std::string& keys) {
    return R"({"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"width":8,"height":6,)" +
           keys + "}";
  };
  const auto error_of = [&](const std::string& keys) {
    std::ofstream(path) << "[" + entry(R"("fx":5,"fy":5)") + "," + entry(keys) + "]";
    // A list that need not be whole lacks that one alone.
    const auto listed = io::read_camera_list(path);
    CHECK(listed.at(0).has_value());
    CHECK_FALSE(listed.at(1).has_value());
    const std::string message = test::data_error([&] { io::read_listed_views(path); });
    CHECK(test::contains(message, "cameras.json, entry 1"));
    return message;
  };
  CHECK(test::contains(error_of(R"("fx":5,"fy":5,"cx":[4])"), "'cx' is not a number"));
  CHECK(test::contains(error_of(R"("fx":5,"fy":5,"k1":"much")"), "'k1' is not a number"));
  CHECK(test::contains(error_of(R"("fx":5,"fy":5,"camera_model":7)"), "is not a text"));
  CHECK(test::contains(error_of(R"("fx":5,"fy":5,"camera_model":"MAGIC")"), "'MAGIC'"));
  CHECK(test::contains(error_of(R"("fx":5,"fy":5,"camera_model":"FISHEYE624")"), "twelve numbers"));
  CHECK(test::contains(error_of(R"("fx":5,"camera_model":"OPENCV_FISHEYE")"), "'fx' and 'fy'"));
  std::ofstream(path) << "[" + entry(R"("fx":5,"fy":5,"camera_model":"OPENCV","k1":1e9)") + "]";
  CHECK(test::contains(test::data_error([&] { io::read_listed_views(path); }), "has a lens"));
}

TEST_CASE("models of no run have no cameras, and damaged files are told") {
  const TemporaryDirectory folder;
  ModelSource alone;
  alone.file = folder.path() / "model.ply";
  CHECK(run_cameras(alone).empty());
  const fs::path run = folder.path() / "run";
  CHECK(run_cameras(model_of(run)).empty());
  fs::create_directories(run);
  const std::string sound =
      R"("position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"width":8,"height":6)";
  const auto read = [&](const std::string& text) {
    std::ofstream(run / "cameras.json") << text;
    return run_cameras(model_of(run));
  };
  const LogCapture log;
  CHECK(read("[]").empty());
  CHECK(read("[{" + sound + "}]").at(0).model == CameraModel::kEquirectangular);
  CHECK(log.lines() == 0);
  CHECK(read("[{\"fx\":5,\"fy\":5," + sound + "}]").at(0).model == CameraModel::kPinhole);
  CHECK(log.contains("cameras.json names no lenses or principal points"));
  for (const char* text :
       {"", "[", "[1]", "[{}]", "[{\"position\":[0,0]}]",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,0]],"width":8,"height":6}])",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,-1]],"width":8,"height":6}])",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"width":0,"height":6}])"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(read(text), DataError);
  }
}
