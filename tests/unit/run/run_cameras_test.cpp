// SPDX-License-Identifier: Apache-2.0
#include "run/run_cameras.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "io/camera_list.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/run_folder.hpp"
#include "scene/camera_model.hpp"
#include "unit/temporary_directory.hpp"

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
  CHECK(read("[]").empty());
  CHECK(read("[{" + sound + "}]").at(0).model == CameraModel::kEquirectangular);
  CHECK(read("[{\"fx\":5,\"fy\":5," + sound + "}]").at(0).model == CameraModel::kPinhole);
  for (const char* text :
       {"", "[", "[1]", "[{}]", "[{\"position\":[0,0]}]",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,0]],"width":8,"height":6}])",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,-1]],"width":8,"height":6}])",
        R"([{"position":[0,0,0],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"width":0,"height":6}])"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(read(text), DataError);
  }
}
