// SPDX-License-Identifier: Apache-2.0
// Camera files: intrinsics, poses and models, read and written.
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <string>

#include "raysplats/dataset.hpp"
#include "scene/camera/camera_check.hpp"
#include "unit/io/transforms_fixture.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("cameras take intrinsics from the file or the frame, as focal lengths or angles") {
  const auto cameras = cameras_of(
      file_of("\"w\": 40, \"h\": 30, \"fl_x\": 50, \"cx\": 19, ",
              frame("a.png", 1) + "," +
                  frame("b.png", 1, "\"fl_x\": 60, \"fl_y\": 61, \"cy\": 14, \"w\": 80.0, ") + "," +
                  frame("./../c", 1, "\"camera_angle_x\": 1.0, ") + "," +
                  frame("", 1, "\"camera_angle_x\": 1.0, \"camera_angle_y\": 0.5, ")));
  REQUIRE(cameras.size() == 4);
  CHECK(cameras[0].name == "a.png");
  CHECK(cameras[0].fx == 50);
  CHECK(cameras[0].fy == 50);
  CHECK(cameras[0].cx == 19);
  CHECK(cameras[0].cy == 15);
  CHECK(cameras[1].width == 80);
  CHECK(cameras[1].fx == 60);
  CHECK(cameras[1].fy == 61);
  CHECK(cameras[1].cy == 14);
  CHECK(cameras[2].name == "c");
  CHECK(cameras[2].fx == doctest::Approx(20 / std::tan(0.5)));
  CHECK(cameras[2].fy == cameras[2].fx);
  CHECK(cameras[3].fy == doctest::Approx(15 / std::tan(0.25)));
  CHECK(cameras[3].name == "frame_0003");
}

TEST_CASE("one focal length or angle alone, across or down, means square pixels") {
  const auto cameras =
      cameras_of(file_of("\"w\": 40, \"h\": 30, \"fl_y\": 50, ",
                         frame("a", 1) + "," + frame("b", 1, "\"camera_angle_y\": 0.5, ") + "," +
                             frame("c", 1, "\"fl_y\": 60, \"camera_model\": \"OPENCV_FISHEYE\", ") +
                             "," + frame("d", 1, "\"fl_x\": 70, ") + "," +
                             frame("e", 1, "\"fl_y\": 80, \"camera_angle_x\": 1, ")));
  const double focal[] = {50, 15 / std::tan(0.25), 60, 70, 80};
  REQUIRE(cameras.size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(cameras[i].fx == doctest::Approx(focal[i]).epsilon(1e-12));
    CHECK(cameras[i].fy == cameras[i].fx);
  }
  CHECK(cameras[2].model == CameraModel::kFisheye);
  // An angle of the file alone.
  const Camera plain =
      cameras_of(file_of("\"w\": 40, \"h\": 30, \"camera_angle_y\": 0.5, ", frame("a", 1))).front();
  CHECK(plain.fx == doctest::Approx(15 / std::tan(0.25)).epsilon(1e-12));
}

TEST_CASE("OpenGL's camera axes become ours: y down, z forward") {
  const Camera camera =
      cameras_of(file_of("\"w\": 4, \"h\": 4, \"fl_x\": 5, ", frame("a", 7))).front();
  CHECK(glm::length(camera.center() - glm::dvec3(7, 2, 3)) < 1e-12);
  // The camera looks along the third column of the matrix, negated, and its up is the second
  // column.
  CHECK(glm::length(camera.rotation * glm::dvec3(-0.6, 0, -0.8) - glm::dvec3(0, 0, 1)) < 1e-12);
  CHECK(glm::length(camera.rotation * glm::dvec3(0, 1, 0) - glm::dvec3(0, -1, 0)) < 1e-12);
  CHECK(glm::length(camera.rotation * glm::dvec3(0.8, 0, -0.6) - glm::dvec3(1, 0, 0)) < 1e-12);
}

TEST_CASE("written cameras read back, with shared and with own intrinsics") {
  const Scratch scratch;
  std::vector<Camera> cameras;
  for (int i = 0; i < 5; ++i) {
    Camera camera = look_at({3 + i, 2, 0.1}, {0, 0.5, 0}, {0, 0, 1}, 64, 48, 70.123456789);
    camera.name = "view/" + std::to_string(i) + ".png";
    cameras.push_back(camera);
  }
  for (const bool shared : {true, false}) {
    if (!shared) cameras[2].cx = 31.0 / 3.0;
    write_cameras(scratch / "cameras.json", cameras);
    const std::string text = read_bytes(scratch / "cameras.json");
    const std::vector<Camera> again = read_cameras(scratch / "cameras.json");
    REQUIRE(again.size() == cameras.size());
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      CHECK(again[i].name == cameras[i].name);
      CHECK(again[i].width == 64);
      CHECK(again[i].height == 48);
      CHECK(again[i].fx == cameras[i].fx);
      CHECK(again[i].cx == cameras[i].cx);
      CHECK(glm::length(again[i].translation - cameras[i].translation) < 1e-12);
      for (int c = 0; c < 3; ++c)
        CHECK(glm::length(again[i].rotation[c] - cameras[i].rotation[c]) < 1e-12);
    }
  }
}

TEST_CASE("cameras of every model are written and read back, together and one by one") {
  const Scratch scratch;
  std::vector<Camera> cameras;
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye,
        CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    Camera camera = look_at({3, 2, 0.1}, {0, 0.5, 0}, {0, 0, 1}, 64, 48, 70.123456789);
    camera.name = "a.png";
    camera.model = model;
    if (model == CameraModel::kOpenCv) camera.distortion = {0.1, 0.02, 0.003, 0.004, 0.005, 0};
    if (model == CameraModel::kFisheye) camera.distortion = {0.1, 0.02, 0.003, 0, 0, 0.0006};
    if (model == CameraModel::kEquirectangular) {
      camera.fx = 32;
      camera.fy = 48;
    }
    cameras.push_back(camera);
  }
  const auto check = [](const Camera& a, const Camera& b) {
    CHECK(a.model == b.model);
    CHECK(a.fx == b.fx);
    CHECK(a.fy == b.fy);
    CHECK(a.cx == b.cx);
    CHECK(a.cy == b.cy);
    CHECK(a.distortion.k1 == b.distortion.k1);
    CHECK(a.distortion.k2 == b.distortion.k2);
    CHECK(a.distortion.k3 == b.distortion.k3);
    CHECK(a.distortion.k4 == b.distortion.k4);
    CHECK(a.distortion.p1 == b.distortion.p1);
    CHECK(a.distortion.p2 == b.distortion.p2);
    CHECK(glm::length(a.center() - b.center()) < 1e-12);
  };
  write_cameras(scratch / "all.json", cameras);
  const std::vector<Camera> all = read_cameras(scratch / "all.json");
  REQUIRE(all.size() == cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    CAPTURE(i);
    check(all[i], cameras[i]);
    write_cameras(scratch / "one.json", {cameras[i], cameras[i]});
    check(read_cameras(scratch / "one.json").back(), cameras[i]);
    Camera wide = cameras[i];
    wide.width = 65;
    if (wide.model == CameraModel::kEquirectangular) wide.fx = wide.cx = 32.5;
    write_cameras(scratch / "two.json", {cameras[i], wide});
    check(read_cameras(scratch / "two.json").front(), cameras[i]);
    check(read_cameras(scratch / "two.json").back(), wide);
  }
}

TEST_CASE("cameras that could not be read back are not written, and what was there stays") {
  const Scratch scratch;
  const Camera sound = look_at({3, 2, 0.1}, {0, 0.5, 0}, {0, 0, 1}, 64, 48, 70);
  const auto path = scratch / "cameras.json";
  write_cameras(path, {sound});
  const std::string before = read_bytes(path);
  const auto refused = [&](const char* what, auto&& spoil) {
    CAPTURE(what);
    Camera camera = sound;
    camera.name = "a.png";
    spoil(camera);
    const std::string message = message_of<UsageError>([&] {
      write_cameras(path, {sound, camera});
    });
    INFO(message);
    CHECK(contains(message, "'a.png'"));
    CHECK((read_bytes(path) == before));
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  refused("fx", [&](Camera& c) { c.fx = nan; });
  refused("cy", [&](Camera& c) { c.cy = nan; });
  refused("pose", [&](Camera& c) { c.translation.y = nan; });
  refused("rotation", [&](Camera& c) { c.rotation = 2.0 * c.rotation; });
  refused("distortion", [&](Camera& c) {
    c.model = CameraModel::kOpenCv;
    c.distortion.k2 = nan;
  });
  refused("no pixels", [](Camera& c) { c.height = 0; });
  refused("no lens", [](Camera& c) { c.model = CameraModel::kPhotoLens; });
}

TEST_CASE("names of camera models: nerfstudio's, and instant-ngp's flag") {
  const std::string size = "\"w\": 40, \"h\": 20, ";
  const auto model = [&](const std::string& keys) {
    return cameras_of(file_of(size + keys, frame("a", 1))).front();
  };
  CHECK(model("\"fl_x\": 9, \"camera_model\": \"OPENCV\", ").model == CameraModel::kPinhole);
  CHECK(model("\"fl_x\": 9, \"k1\": 0.1, ").model == CameraModel::kOpenCv);
  CHECK(model("\"fl_x\": 9, \"k1\": 0.1, \"is_fisheye\": true, ").model == CameraModel::kFisheye);
  const Camera fisheye =
      model("\"fl_x\": 9, \"k1\": 0.1, \"k4\": 0.4, \"camera_model\": \"OPENCV_FISHEYE\", ");
  CHECK(fisheye.model == CameraModel::kFisheye);
  CHECK(fisheye.distortion.k4 == 0.4);
  const Camera panorama = model("\"camera_model\": \"EQUIRECTANGULAR\", ");
  CHECK(panorama.model == CameraModel::kEquirectangular);
  CHECK(panorama.fx == 20);
  CHECK(panorama.fy == 20);
  CHECK(model("\"fl_x\": 9, \"camera_model\": \"ORTHOPHOTO\", ").model ==
        CameraModel::kOrthographic);
}

TEST_CASE("small deviations from a rotation are removed, larger ones refused") {
  const auto with_matrix = [](const std::string& matrix) {
    return "{\"w\": 4, \"h\": 4, \"fl_x\": 5, \"frames\": [{\"transform_matrix\": " + matrix +
           "}]}";
  };
  const Camera camera =
      cameras_of(with_matrix("[[0.8003, 0, 0.6, 1], [0, 1, 0, 2], [-0.6, 0, 0.8, 3]]")).front();
  const glm::dmat3 gram = glm::transpose(camera.rotation) * camera.rotation;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) CHECK(std::abs(gram[i][j] - (i == j ? 1 : 0)) < 1e-12);
  }
  CHECK(glm::length(camera.center() - glm::dvec3(1, 2, 3)) < 1e-12);
  // A camera that was scaled as an object sees the same.
  const LogCapture log;
  const Camera scaled =
      cameras_of(with_matrix("[[1.6, 0, 1.8, 1], [0, 0.5, 0, 2], [-1.2, 0, 2.4, 3]]")).front();
  CHECK(log.contains("1 of 1 cameras"));
  const Camera plain =
      cameras_of(with_matrix("[[0.8, 0, 0.6, 1], [0, 1, 0, 2], [-0.6, 0, 0.8, 3]]")).front();
  CHECK(glm::length(scaled.center() - plain.center()) < 1e-12);
  for (int i = 0; i < 3; ++i) CHECK(glm::length(scaled.rotation[i] - plain.rotation[i]) < 1e-12);
  // Axes between what is left as it is and what counts as scaled, and numbers of two decimals.
  for (const char* matrix :
       {"[[0.80056, 0, 0.60042, 1], [0, 1.0007, 0, 2], [-0.60042, 0, 0.80056, 3]]",
        "[[0.72, -0.48, 0.5, 1], [0.57, 0.82, -0.03, 2], [-0.4, 0.3, 0.86, 3]]"}) {
    CAPTURE(matrix);
    CHECK(is_rotation(cameras_of(with_matrix(matrix)).front().rotation, 1e-12));
  }
  CHECK(contains(cameras_error(with_matrix("[[1,0.1,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")),
                 "no rotation"));
  CHECK(contains(cameras_error(with_matrix("[[0,0,0,0],[0,0,0,0],[0,0,0,0],[0,0,0,1]]")),
                 "no rotation"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0,0],[0,1,0,0],[0,0,-1,0],[0,0,0,1]]")),
                 "no rotation"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]")),
                 "last row"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0,0],[0,1,0,0]]")), "4 rows"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0],[0,1,0],[0,0,1]]")), "4 numbers"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0,\"x\"],[0,1,0,0],[0,0,1,0]]")), "no number"));
  CHECK(contains(cameras_error(with_matrix("[[1,0,0,NaN],[0,1,0,0],[0,0,1,0]]")), "by 'NaN'"));
  CHECK(
      contains(cameras_error(with_matrix("[[1,0,0,1e999],[0,1,0,0],[0,0,1,0]]")), "out of range"));
  CHECK(contains(cameras_error(with_matrix("7")), "4 rows"));
}

TEST_CASE("malformed camera files are refused with the frame or the line") {
  CHECK(contains(cameras_error(""), "line 1"));
  CHECK(contains(cameras_error("{\"frames\":\n["), "line 2"));
  CHECK(contains(cameras_error("7"), "no JSON object"));
  CHECK(contains(cameras_error("{}"), "no list of frames"));
  CHECK(contains(cameras_error("{\"frames\": []}"), "no frames"));
  CHECK(contains(cameras_error("{\"frames\": [3]}"), "frame 0"));
  CHECK(contains(cameras_error("{\"x\": " + std::string(100000, '[')), "levels deep"));
  CHECK(contains(cameras_error(file_of("", frame("a", 1))), "\"w\" and \"h\""));
  CHECK(contains(cameras_error(file_of("\"w\": 4, \"h\": 4, ", frame("a", 1))),
                 "neither fl_x nor camera_angle_x"));
  CHECK(contains(cameras_error(file_of("\"w\": 4, \"h\": 4, \"fl_x\": -1, ", frame("a", 1))),
                 "'fl_x' is -1"));
  CHECK(contains(cameras_error(file_of("\"w\": 4, \"h\": 4, \"fl_x\": \"1 px\", ", frame("a", 1))),
                 "'fl_x' is not a number"));
  CHECK(contains(cameras_error(file_of("\"w\": 4.5, \"h\": 4, ", frame("a", 1))), "'w' is 4.5"));
  CHECK(
      contains(cameras_error(file_of("\"w\": 1e30, \"h\": 4, ", frame("a", 1))), "no image size"));
  CHECK(
      contains(cameras_error(file_of("\"w\": 4, \"h\": 4, \"camera_angle_x\": 4, ", frame("a", 1))),
               "no plane"));
  CHECK(contains(cameras_error(file_of("\"camera_model\": \"MEI\", ", frame("a", 1))), "'MEI'"));
  CHECK(contains(cameras_error(file_of("", frame("a", 1, "\"camera_model\": \"VR180_L\", "))),
                 "frame 0"));
  CHECK(contains(cameras_error(file_of("\"w\": 4, \"h\": 4, \"is_fisheye\": true, "
                                       "\"camera_angle_x\": 1, ",
                                       frame("a", 1))),
                 "no fl_x"));
  CHECK(contains(data_error([] { read_cameras("/nonexistent.json"); }), "does not exist"));
}

TEST_CASE("cameras that no photo can have been taken with are refused by name") {
  const Scratch scratch;
  write_image(scratch / "train/far.png", Image(20, 10, 3, 0.5f));
  write_bytes(scratch / "transforms_train.json",
              file_of("\"camera_angle_x\": 0.8, ", frame("train/far", 1e30)));
  std::string message = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(message, "far.png"));
  CHECK(contains(message, "from the origin"));
  CHECK(contains(cameras_error(file_of("\"fl_x\": 20, \"w\": 20, \"h\": 10, ", frame("far", 1e30))),
                 "the camera of frame 0"));
  const auto lens = [](const std::string& model, const std::string& terms) {
    return file_of(
        "\"fl_x\": 20, \"w\": 20, \"h\": 10, \"camera_model\": \"" + model + "\", " + terms + ", ",
        frame("a", 1));
  };
  CHECK(contains(cameras_error(lens("OPENCV", "\"k1\": 1e9")), "k1 1e+09"));
  CHECK(contains(cameras_error(lens("OPENCV", "\"p2\": 1e9")), "p2 1e+09"));
  CHECK(contains(cameras_error(lens("OPENCV_FISHEYE", "\"k4\": 1e9")), "k4 1e+09"));
  // Strong lenses and far places are none.
  CHECK(cameras_of(lens("OPENCV", "\"k1\": -0.4, \"k2\": 0.3, \"k3\": -0.1")).size() == 1);
  CHECK(cameras_of(lens("OPENCV_FISHEYE", "\"k1\": 0.1, \"k4\": -0.01")).size() == 1);
  CHECK(cameras_of(file_of("\"fl_x\": 20, \"w\": 20, \"h\": 10, ", frame("a", 5e6))).size() == 1);
  // So is a lens of a telephoto, whose terms are large because r is small.
  CHECK(cameras_of(file_of("\"fl_x\": 4000, \"w\": 20, \"h\": 10, \"k3\": 1e4, "
                           "\"camera_model\": \"OPENCV\", ",
                           frame("a", 1)))
            .size() == 1);
}

TEST_CASE("no cut or flipped byte of a camera file does anything but load or raise DataError") {
  const Scratch scratch;
  const std::string whole =
      file_of("\"w\": 40, \"h\": 30, \"fl_x\": 50, \"k1\": 0.1, \"is_fisheye\": false, ",
              frame("a.png", 1) + "," + frame("b.png", 2));
  CounterRng rng(10, 11);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    CHECK(cameras_error(whole.substr(0, length)) != "");
  }
  for (int trial = 0; trial < 1000; ++trial) {
    std::string bytes = whole;
    for (int i = 0; i < 2; ++i)
      bytes[rng.below(bytes.size())] = static_cast<char>(32 + rng.below(95));
    write_bytes(scratch / "bad.json", bytes);
    data_error([&] { read_cameras(scratch / "bad.json"); });
  }
}
