// SPDX-License-Identifier: Apache-2.0
// The cameras that a scene file places, or takes from a file or a data set.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/io/scene_folder.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("scene file: placed cameras of every model") {
  const SceneFolder folder;
  const SceneExtent extent{{1, 0, 0}, 2.0};
  const auto camera = [&](const std::string& keys) {
    const SceneFile scene = folder.read(kModel + "[camera]\n" + keys);
    const std::vector<Camera> all = scene_cameras(scene.camera, extent, 5, {});
    REQUIRE(all.size() == 1);
    return all[0];
  };
  const std::string pose = "position = [0, 0, -4]\ntarget = [0, 0, 1]\nup = [0, -1, 0]\n";
  /// Angle between the axis and the ray through the middle of the picture's lower side.
  const auto half_angle = [](const Camera& c) {
    const CameraRay axis = camera_ray(c, c.cx, c.cy);
    const CameraRay side = camera_ray(c, c.cx, c.height);
    REQUIRE(side.valid);
    return glm::degrees(std::acos(glm::dot(axis.direction, side.direction)));
  };

  const Camera pinhole = camera(pose + "fov = 60\nwidth = 400\nheight = 300\n");
  CHECK(pinhole.model == CameraModel::kPinhole);
  CHECK(pinhole.width == 400);
  CHECK(pinhole.height == 300);
  CHECK(near(pinhole.center(), {0, 0, -4}));
  CHECK(near(camera_ray(pinhole, 200, 150).direction, {0, 0, 1}));
  CHECK(half_angle(pinhole) == doctest::Approx(30.0));
  CHECK(camera(pose).width == 800);
  CHECK(half_angle(camera(pose)) == doctest::Approx(22.5));
  const Camera focal = camera(pose + "focal = 123\nprincipal-point = [10, 20]\n");
  CHECK(focal.fx == 123.0);
  CHECK(focal.fy == 123.0);
  CHECK(focal.cx == 10.0);
  CHECK(focal.cy == 20.0);

  const Camera opencv = camera(
      pose + "model = 'opencv'\nfov = 50\nk1 = -0.1\nk2 = 0.01\nk3 = 0.001\np1 = 0\np2 = 0.002\n");
  CHECK(opencv.model == CameraModel::kOpenCv);
  CHECK(opencv.distortion.k1 == -0.1);
  CHECK(opencv.distortion.k2 == 0.01);
  CHECK(opencv.distortion.k3 == 0.001);
  CHECK(opencv.distortion.p2 == 0.002);
  const Camera fisheye = camera(
      pose + "model = 'fisheye'\nfov = 190\nk1 = 0.01\nk2 = 0.002\nk3 = 0.001\nk4 = 0.0001\n");
  CHECK(fisheye.model == CameraModel::kFisheye);
  CHECK(fisheye.distortion.k4 == 0.0001);
  CHECK(half_angle(fisheye) == doctest::Approx(95.0));
  CHECK(half_angle(camera(pose + "model = 'opencv'\nfov = 50\nk1 = -0.1\n")) ==
        doctest::Approx(25.0));
  const Camera round = camera(pose + "model = 'equirectangular'\nwidth = 200\n");
  CHECK(round.model == CameraModel::kEquirectangular);
  CHECK(round.height == 100);
  CHECK(near(camera_ray(round, 100, 50).direction, {0, 0, 1}));
  const Camera flat = camera(pose + "model = 'orthographic'\nextent = 4\nheight = 400\n");
  CHECK(flat.model == CameraModel::kOrthographic);
  CHECK(flat.fx == doctest::Approx(100.0));
  CHECK(glm::length(camera_ray(flat, 400, 0).origin - camera_ray(flat, 400, 400).origin) ==
        doctest::Approx(4.0));

  const SceneFile folding =
      folder.read(kModel + "[camera]\n" + pose + "model = 'opencv'\nk1 = -1\nfov = 120\n");
  CHECK_THROWS_AS(scene_cameras(folding.camera, extent, 1, {}), UsageError);
  const SceneFile none = folder.read(kModel);
  CHECK_THROWS_AS(scene_cameras(none.camera, extent, 1, {}), UsageError);
}

TEST_CASE("scene file: cameras of files, data sets and orbits") {
  const SceneFolder folder;
  const SceneExtent extent{{1, 0, 0}, 2.0};
  Camera base;
  base.width = 40;
  base.height = 20;
  base.fx = base.fy = 30;
  base.cx = 20;
  base.cy = 10;
  std::vector<Camera> written(4, base);
  for (std::size_t i = 0; i < written.size(); ++i) {
    written[i].name = "view_" + std::to_string(i);
    written[i].translation.z = 3.0 + static_cast<double>(i);
  }
  write_cameras(folder.scratch() / "transforms.json", written);

  const SceneFile file =
      folder.read(kModel + "[camera]\nfile = 'transforms.json'\ndownscale = 2\nviews = [3, 1]\n");
  const std::vector<Camera> chosen = scene_cameras(file.camera, extent, 1, {});
  REQUIRE(chosen.size() == 2);
  CHECK(chosen[0].name == "view_3");
  CHECK(chosen[1].name == "view_1");
  CHECK(chosen[0].width == 20);
  CHECK(chosen[0].fx == doctest::Approx(15.0));
  const SceneFile beyond =
      folder.read(kModel + "[camera]\nfile = 'transforms.json'\nviews = [4]\n");
  CHECK_THROWS_AS(scene_cameras(beyond.camera, extent, 1, {}), UsageError);

  const SceneFile orbit = folder.read(kModel + R"([camera]
width = 60
height = 40
fov = 50
up = [0, 0, 1]
orbit = { frames = 7, elevation = 10, distance = 5, target = [1, 2, 3] }
)");
  const std::vector<Camera> ring = scene_cameras(orbit.camera, extent, 3, {});
  REQUIRE(ring.size() == 7);
  for (const Camera& each : ring) {
    CHECK(each.width == 60);
    CHECK(glm::length(each.center() - glm::dvec3(1, 2, 3)) == doctest::Approx(5.0));
    CHECK(each.center().z == doctest::Approx(3 + 5 * std::sin(glm::radians(10.0))));
  }
  // Without a number the orbit takes as many frames as the animation, around what is there.
  const SceneFile free = folder.read(kModel + "[camera]\norbit = {}\nmodel = 'fisheye'\n");
  const std::vector<Camera> three = scene_cameras(free.camera, extent, 3, {});
  REQUIRE(three.size() == 3);
  CHECK(three[0].model == CameraModel::kFisheye);
  CHECK(near(three[0].center() + three[1].center() + three[2].center() -
                 3.0 * glm::dvec3(0, three[0].center().y, 0),
             {3, 0, 0}));
}

TEST_CASE("scene file: cameras count from the model's origin, data sets are as it was trained") {
  const SceneFolder folder;
  const SceneExtent extent;
  DatasetOptions trained;
  trained.downscale = 4;
  trained.test_every = 2;
  trained.origin = {4321012.125, -250000.5, 80.0};
  const glm::dvec3 origin(4321012.125, -250000.5, 80.0);

  Camera camera = look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 40, 30, 30.0);
  camera.translation -= camera.rotation * origin;  // as a survey has it
  write_cameras(folder.scratch() / "transforms.json", std::vector{camera});
  const auto cameras = [&](const std::string& keys) {
    return scene_cameras(folder.read(kModel + "[camera]\n" + keys).camera, extent, 1, trained);
  };
  const auto check_file = [&](const std::vector<Camera>& all) {
    REQUIRE(all.size() == 1);
    CHECK(glm::length(all[0].center() - glm::dvec3(0, 0, -6)) < 1e-6);
    CHECK(all[0].width == 40);  // of photos alone is the size that of the training
  };
  check_file(cameras("file = 'transforms.json'\n"));
  SceneCamera given;
  given.source = SceneCamera::Source::kGiven;
  given.given = {camera};
  check_file(scene_cameras(given, extent, 1, trained));

  const ColmapFixture photos = small_colmap();
  photos.write_binary(folder.scratch() / "data/sparse/0");
  write_photos(photos, folder.scratch() / "data/images", 40, 30);
  DatasetOptions halved;
  halved.test_every = 2;
  const Dataset data = load_dataset(folder.scratch() / "data", halved);
  const View& first = data.views.at(data.indices(Split::kTest).at(0));
  const std::vector<Camera> test = cameras("data = 'data'\n");
  REQUIRE(test.size() == 5);
  CHECK(test[0].width == 10);
  CHECK(test[0].name == first.camera.name);
  CHECK(glm::length(test[0].center() - first.camera.center() + origin) < 1e-6);
  // What is given goes over it.
  const std::vector<Camera> more = cameras("data = 'data'\ndownscale = 2\ntest-every = 5\n");
  REQUIRE(more.size() == 2);
  CHECK(more[0].width == 20);
  write_bytes(folder.scratch() / "list.txt", "photo 4\nphoto 9.png\n");
  CHECK(cameras("data = 'data'\ntest-list = 'list.txt'\n").size() == 2);
  CHECK(contains(message_of<UsageError>(
                     [&] { cameras("data = 'data'\ntest-every = 5\ntest-list = 'list.txt'\n"); }),
                 "contradict each other"));
  trained.test_list = {"another.png"};
  CHECK(cameras("data = 'data'\ntest-every = 5\n").size() == 2);
  const Camera on_orbit = cameras("data = 'data'\norbit = { frames = 1 }\n").at(0);
  CHECK(on_orbit.width == 10);
  CHECK(on_orbit.height == 8);
  // A panorama has its own shape.
  const std::string round = "data = 'data'\norbit = {}\nmodel = 'equirectangular'\n";
  CHECK(cameras(round).at(0).width == 10);
  CHECK(cameras(round).at(0).height == 5);
  CHECK(cameras(round + "width = 300\n").at(0).height == 150);
  CHECK(cameras(round + "height = 30\n").at(0).height == 30);
}

TEST_CASE("scene file: another size keeps what the smaller side sees") {
  Camera camera = look_at({0, 0, -3}, {0, 0, 0}, {0, -1, 0}, 800, 600, 500);
  const Camera half = resized(camera, 400, std::nullopt);
  CHECK(half.width == 400);
  CHECK(half.height == 300);
  CHECK(half.fx == 250.0);
  CHECK(half.cy == 150.0);
  const Camera square = resized(camera, 300, 300);
  CHECK(square.fx == 250.0);
  CHECK(square.fy == 250.0);
  CHECK(square.cx == 150.0);
  CHECK(resized(camera, std::nullopt, 1200).width == 1600);
  CHECK(resized(camera, std::nullopt, std::nullopt).fx == 500.0);
}
