// SPDX-License-Identifier: Apache-2.0
// Camera files in the dialects and with the flaws of programs that write them.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "unit/io/transforms_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

std::string frame_with(const std::string& matrix, const std::string& more = "") {
  return fmt::format("{{\"file_path\": \"a\", {}\"transform_matrix\": {}}}", more, matrix);
}

const std::string kKeys = "\"w\": 40, \"h\": 30, \"fl_x\": 50, ";

void check_same_pose(const Camera& a, const Camera& b) {
  CHECK(glm::length(a.translation - b.translation) < 1e-12);
  for (int i = 0; i < 3; ++i) CHECK(glm::length(a.rotation[i] - b.rotation[i]) < 1e-12);
}

/// A data set of these photos, which are written but for those that are to be missing.
void write_scene(const Scratch& scratch,
                 const std::vector<std::string>& names,
                 const std::vector<std::string>& written,
                 const std::string& keys = "") {
  for (const std::string& name : written) write_image(scratch / name, Image(40, 30, 3, 0.5f));
  std::string frames;
  for (std::size_t i = 0; i < names.size(); ++i) {
    frames += fmt::format("{}{{\"file_path\": \"{}\", \"transform_matrix\": {}}}",
                          i > 0 ? ", " : "", names[i], matrix_json(static_cast<double>(i)));
  }
  write_bytes(scratch / "transforms.json", file_of(kKeys + keys, frames));
}

}  // namespace

TEST_CASE("names of camera models may be spelt in any case and with any separator") {
  const auto model = [](const std::string& name) {
    return cameras_of(file_of(kKeys + "\"k1\": 0.01, \"camera_model\": \"" + name + "\", ",
                              frame_with(matrix_json(1))))
        .front()
        .model;
  };
  CHECK(model("opencv") == CameraModel::kOpenCv);
  CHECK(model("OpenCV Fisheye") == CameraModel::kFisheye);
  CHECK(model("simple-radial") == CameraModel::kOpenCv);
  CHECK(model("equirectangular") == CameraModel::kEquirectangular);
  CHECK(contains(cameras_error(file_of("\"camera_model\": \"open_gl\", ", "")), "'open_gl'"));
}

TEST_CASE("camera models that other programs name otherwise are the lenses that they are") {
  const auto camera = [](const std::string& name) {
    return cameras_of(
               file_of(kKeys + "\"k1\": 0.1, \"k2\": 0.02, \"camera_model\": \"" + name + "\", ",
                       frame_with(matrix_json(1))))
        .front();
  };
  const auto check_lens = [&](const char* name, CameraModel model) {
    CAPTURE(name);
    CHECK(camera(name).model == model);
    CHECK(camera(name).distortion.k1 == 0.1);
    CHECK(camera(name).distortion.k2 == 0.02);
  };
  for (const char* name : {"BROWN_CONRADY", "brown-conrady", "PERSPECTIVE"})
    check_lens(name, CameraModel::kOpenCv);
  for (const char* name :
       {"RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE", "kannala-brandt4", "KANNALA_BRANDT", "FISHEYE"})
    check_lens(name, CameraModel::kFisheye);
  // Lenses of other terms, or that go the other way.
  for (const char* name : {"INVERSE_BROWN_CONRADY", "MODIFIED_BROWN_CONRADY", "FULL_OPENCV",
                           "THIN_PRISM_FISHEYE", "FTHETA"}) {
    const std::string message = cameras_error(
        file_of(fmt::format("\"camera_model\": \"{}\", ", name), frame_with(matrix_json(1))));
    CHECK(contains(message, fmt::format("'{}' is not supported", name)));
    CHECK(contains(message, "OPENCV, BROWN_CONRADY, "));
    CHECK(contains(message, "FISHEYE624"));
  }
}

TEST_CASE("numbers that were written as texts are numbers, other texts are none") {
  const Camera camera =
      cameras_of(file_of("\"w\": \"40\", \"h\": \"30\", \"fl_x\": \"5e1\", \"cx\": \"-1.5\", ",
                         frame_with("[[\"0.8\", 0, 0.6, \"7\"], [0, 1, 0, 2], [-0.6, 0, 0.8, 3]]")))
          .front();
  CHECK(camera.width == 40);
  CHECK(camera.fx == 50);
  CHECK(camera.cx == -1.5);
  // Numbers that are too small for a double are 0.
  for (const char* text : {"1e-400", "-1e-400", "+0.001e-4000"}) {
    CAPTURE(text);
    const std::string keys = kKeys + fmt::format("\"cx\": \"{}\", ", text);
    CHECK(cameras_of(file_of(keys, frame_with(matrix_json(1)))).front().cx == 0);
  }
  CHECK(glm::length(camera.center() - glm::dvec3(7, 2, 3)) < 1e-12);
  for (const char* text : {"50 px", "", "nan", "inf", "1e400", "1e-400 px"}) {
    CHECK(contains(
        cameras_error(file_of(fmt::format("\"fl_x\": \"{}\", ", text), frame_with(matrix_json(1)))),
        "'fl_x' is not"));
  }
}

TEST_CASE("angles of view are read in degrees too, of the file or the frame") {
  const auto cameras = cameras_of(
      file_of("\"w\": 40, \"h\": 30, \"x_fov\": 60, ",
              frame_with(matrix_json(1)) + "," + frame_with(matrix_json(1), "\"y_fov\": 90, ") +
                  "," + frame_with(matrix_json(1), "\"x_fov\": 90, \"y_fov\": 60, ") + "," +
                  frame_with(matrix_json(1), "\"fl_x\": 33, ")));
  REQUIRE(cameras.size() == 4);
  CHECK(cameras[0].fx == doctest::Approx(20 * std::numbers::sqrt3).epsilon(1e-12));
  CHECK(cameras[0].fy == cameras[0].fx);
  CHECK(cameras[1].fx == doctest::Approx(15).epsilon(1e-12));
  CHECK(cameras[2].fx == doctest::Approx(20).epsilon(1e-12));
  CHECK(cameras[2].fy == doctest::Approx(15 * std::numbers::sqrt3).epsilon(1e-12));
  CHECK(cameras[3].fy == 33);
}

TEST_CASE("angles that no plane has are refused where they count") {
  const auto read = [](const std::string& keys, const std::string& frame_keys = "") {
    return cameras_of(
               file_of("\"w\": 40, \"h\": 30, " + keys, frame_with(matrix_json(1), frame_keys)))
        .front();
  };
  const auto refused = [&](const std::string& keys) { return data_error([&] { read(keys); }); };
  for (const char* key : {"\"x_fov\": 180, ", "\"y_fov\": 200, ", "\"camera_angle_x\": 3.2, "}) {
    CHECK(contains(refused(key), "frame 0 has an angle of view of "));
    CHECK(contains(refused(key), "no plane shows 180 degrees"));
  }
  CHECK(contains(refused("\"camera_angle_x\": 6.2831853, \"x_fov\": 60, "), "of 360 degrees"));
  CHECK(contains(refused("\"x_fov\": 0, "), "not positive"));
  CHECK(contains(refused("\"camera_angle_y\": -1, "), "not positive"));
  const std::string turn = "\"camera_angle_x\": 6.283185307179586, ";
  CHECK(read(turn + "\"camera_model\": \"EQUIRECTANGULAR\", ").model ==
        CameraModel::kEquirectangular);
  CHECK(
      read("\"camera_angle_x\": 3.3161, \"camera_model\": \"OPENCV_FISHEYE\", \"fl_x\": 12, ").fx ==
      12);
  CHECK(read("\"x_fov\": 190, \"fl_x\": 12, ").fx == 12);
  CHECK(read(turn, "\"x_fov\": 90, ").fx == doctest::Approx(20).epsilon(1e-12));
}

TEST_CASE("matrices may be three rows, or one list; transposed ones are refused by name") {
  const Camera expected = cameras_of(file_of(kKeys, frame_with(matrix_json(7)))).front();
  for (const char* matrix : {"[[0.8, 0, 0.6, 7], [0, 1, 0, 2], [-0.6, 0, 0.8, 3]]",
                             "[0.8, 0, 0.6, 7, 0, 1, 0, 2, -0.6, 0, 0.8, 3]",
                             "[0.8, 0, 0.6, 7, 0, 1, 0, 2, -0.6, 0, 0.8, 3, 0, 0, 0, 1]"}) {
    check_same_pose(cameras_of(file_of(kKeys, frame_with(matrix))).front(), expected);
  }
  for (const char* matrix : {"[[0.8, 0, -0.6, 0], [0, 1, 0, 0], [0.6, 0, 0.8, 0], [7, 2, 3, 1]]",
                             "[0.8, 0, -0.6, 0, 0, 1, 0, 0, 0.6, 0, 0.8, 0, 7, 2, 3, 1]"}) {
    CHECK(contains(cameras_error(file_of(kKeys, frame_with(matrix))), "transpose"));
  }
  for (const char* matrix : {"[1, 2, 3]", "[]", "[0.8, 0, 0.6, 7, 0, 1, 0, 2, -0.6, 0, 0.8, 3, 0]",
                             "[[1, 0, 0, 0], 1, 2, 3]"}) {
    CHECK(contains(cameras_error(file_of(kKeys, frame_with(matrix))), "4 numbers"));
  }
}

TEST_CASE("keys of other programs: scales of the scene do nothing, axes of the cameras do") {
  const Camera expected = cameras_of(file_of(kKeys, frame_with(matrix_json(7)))).front();
  check_same_pose(cameras_of(file_of(kKeys + "\"aabb_scale\": 16, \"scale\": 0.33, "
                                             "\"offset\": [0.5, 0.5, 0.5], \"from_na\": false, ",
                                     frame_with(matrix_json(7))))
                      .front(),
                  expected);
  const LogCapture log;
  // NeuS2's second and third axis, Mitsuba's first and third are the other way round.
  check_same_pose(
      cameras_of(file_of(kKeys + "\"from_na\": true, ",
                         frame_with("[[0.8, 0, -0.6, 7], [0, -1, 0, 2], [-0.6, 0, -0.8, 3]]")))
          .front(),
      expected);
  CHECK(log.contains("from_na"));
  check_same_pose(
      cameras_of(file_of(kKeys + "\"normal_mts_args\": [], ",
                         frame_with("[[-0.8, 0, -0.6, 7], [0, 1, 0, 2], [0.6, 0, -0.8, 3]]")))
          .front(),
      expected);
  CHECK(log.contains("Mitsuba"));
}

TEST_CASE("what is true or false may be 1 or 0, and is refused where it is neither") {
  const auto model = [](const std::string& value) {
    return cameras_of(
               file_of(kKeys + "\"is_fisheye\": " + value + ", ", frame_with(matrix_json(1))))
        .front()
        .model;
  };
  for (const char* yes : {"true", "1", "1.0", "\"1\""}) CHECK(model(yes) == CameraModel::kFisheye);
  for (const char* no : {"false", "0", "null"}) CHECK(model(no) == CameraModel::kPinhole);
  for (const char* other : {"2", "\"true\"", "[true]"}) {
    CHECK(contains(data_error([&] { model(other); }),
                   "the file: 'is_fisheye' is neither true nor false"));
  }
  CHECK(contains(cameras_error(file_of(kKeys + "\"from_na\": 3, ", frame_with(matrix_json(1)))),
                 "'from_na' is neither true nor false"));
  const Camera camera = cameras_of(file_of(kKeys + "\"from_na\": 1, ",
                                           frame_with("[[0.8, 0, 0.6, 7], [0, 1, 0, 2], "
                                                      "[-0.6, 0, 0.8, 3], [0, 0, 0, 1]]")))
                            .front();
  CHECK(glm::length(camera.rotation * glm::dvec3(0.6, 0, 0.8) - glm::dvec3(0, 0, 1)) < 1e-12);
}

TEST_CASE("frames without a photo are left out and told, where most have one") {
  const Scratch scratch;
  const std::vector<std::string> names{"a.png", "b.png", "c.png", "d"};
  write_scene(scratch, names, {"a.png", "c.png"},
              "\"train_filenames\": [\"a.png\", \"b.png\"], \"test_filenames\": [\"c.png\"], ");
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 4 frames do not exist, 'b.png' of frame 1"));
    CHECK(log.contains("left out"));
    REQUIRE(dataset.views.size() == 2);
    CHECK(dataset.views[1].camera.name == "c.png");
    CHECK(dataset.views[1].test);
    CHECK(dataset.views[1].camera.center().x == doctest::Approx(2));
  }
  fs::remove(scratch / "a.png");
  const std::string message = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(message, "3 of 4 frames do not exist, 'a.png' of frame 0"));
  CHECK(contains(message, "put them"));
  fs::remove(scratch / "c.png");
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "4 of 4 frames"));
}

TEST_CASE("photos are found in another letter case, unless two differ in nothing else") {
  const Scratch scratch;
  write_scene(scratch, {"images/A.jpg", "images/b", ".\\\\Images\\\\c.PNG"},
              {"Images/a.Jpg", "Images/B.Png", "Images/c.png"});
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    REQUIRE(dataset.views.size() == 3);
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 3 photos are spelt otherwise"));
    CHECK(log.contains("'images/A.jpg'"));
    CHECK(fs::equivalent(dataset.views[1].image_path, scratch / "Images/a.Jpg"));
  }
  write_image(scratch / "Images/a.jpG", Image(40, 30, 3, 0.5f));
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).views.size() == 2);
  CHECK(log.contains("'images/A.jpg' of frame 0"));
}

TEST_CASE("a data set that is reached by a link has the photos beside it, and nothing is told") {
  const Scratch scratch;
  const Scratch other;
  fs::create_directory(scratch / "scene");
  write_scene(scratch, {"../images/a.png", "../images/b.png"}, {"images/a.png", "images/b.png"});
  fs::rename(scratch / "transforms.json", scratch / "scene/transforms.json");
  write_image(other / "images/a.png", Image(40, 30, 3, 0.9f));
  fs::create_directory_symlink(scratch / "scene", other / "scene");
  const LogCapture log;
  const Dataset dataset = load_dataset(other / "scene");
  CHECK(log.lines() == 0);
  REQUIRE(dataset.views.size() == 2);
  for (const View& view : dataset.views)
    CHECK(fs::equivalent(view.image_path.parent_path(), scratch / "images"));
  // A photo that is found by the end of its path keeps its name on such a way.
  write_scene(scratch, {"/old/images/a.png", "/old/images/b.png"}, {});
  for (const View& view : load_dataset(other / "scene/..").views)
    CHECK(view.camera.name == "images/" + view.image_path.filename().string());
}

TEST_CASE("photos are found with another extension, unless two are, or a frame has the photo") {
  const Scratch scratch;
  write_scene(scratch, {"images/a.jpeg", "images/b.PNG", "images/c.png"},
              {"images/a.jpg", "images/b.JPG", "images/c.png"});
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    REQUIRE(dataset.views.size() == 3);
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 3 photos have another extension than"));
    CHECK(log.contains("'images/a.jpeg'"));
    CHECK(fs::equivalent(dataset.views[1].image_path, scratch / "images/b.JPG"));
  }
  write_image(scratch / "images/a.png", Image(40, 30, 3, 0.5f));
  {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 2);
    CHECK(log.contains("'images/a.jpeg' of frame 0"));
  }
  const Scratch other;
  write_scene(other, {"a.png", "a.jpg", "b.png"}, {"a.png", "b.png"});
  const LogCapture log;
  CHECK(load_dataset(other.path()).views.size() == 2);
  CHECK(log.contains("'a.jpg' of frame 1"));
  const Scratch masked;
  write_scene(masked, {"a.jpg\", \"mask_path\": \"a.png", "b.png", "c.png"},
              {"a.png", "b.png", "c.png"});
  CHECK(load_dataset(masked.path()).views.size() == 2);
  CHECK(log.contains("'a.jpg' of frame 0"));
}

TEST_CASE("intrinsics of another size than the photos' are warned of") {
  const Scratch scratch;
  const auto warns = [&](const std::string& keys) {
    write_scene(scratch, {"a.png", "b.png"}, {"a.png", "b.png"}, keys);
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 2);
    const int center = log.contains("The principal point of 2 of 2 photos is far") ? 1 : 0;
    const int angle = log.contains("contradict each other in 2 of 2 frames") ? 2 : 0;
    return center + angle;
  };
  // Photos of 40 x 30 pixels.
  CHECK(warns(R"("cx": 20.5, "cy": 14, )") == 0);
  CHECK(warns(R"("cx": 14, "cy": 18, )") == 0);
  CHECK(warns(R"("cx": 10, "cy": 7.5, )") == 1);
  CHECK(warns(R"("cx": 20, "cy": 3, )") == 1);
  CHECK(warns(R"("w": 20, "h": 15, "cx": 10, "cy": 7.5, )") == 0);
  CHECK(warns(R"("w": 20, "h": 15, "cx": 20, "cy": 15, )") == 1);
  // fl_x is 50.
  CHECK(warns(R"("camera_angle_x": 0.7, )") == 0);
  CHECK(warns(R"("camera_angle_x": 0.395, )") == 2);
  CHECK(warns(R"("camera_angle_x": 1.29, )") == 2);
  CHECK(warns(R"("w": 20, "h": 15, "camera_angle_x": 0.395, )") == 0);
  CHECK(warns(R"("camera_model": "OPENCV_FISHEYE", "camera_angle_x": 1.29, )") == 0);
  CHECK(warns(R"("camera_angle_x": 3.3, )") == 2);
  CHECK(warns(R"("cx": 10, "cy": 7.5, "camera_angle_x": 0.395, )") == 3);
}

TEST_CASE("points that another machine has elsewhere are found beside the file, which is told") {
  const Scratch scratch;
  write_bytes(scratch / "sparse_pc.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\nend_header\n1 2 3\n");
  const auto points = [&](const std::string& path) {
    write_scene(scratch, {"a.png"}, {"a.png"}, fmt::format("\"ply_file_path\": \"{}\", ", path));
    return load_dataset(scratch.path()).points.size();
  };
  {
    const LogCapture log;
    CHECK(points("sparse_pc.ply") == 1);
    CHECK(log.lines() == 0);
  }
  for (const char* path : {R"(C:\\caps\\fox\\sparse_pc.ply)", "/home/u/fox/sparse_pc.ply"}) {
    CAPTURE(path);
    const LogCapture log;
    CHECK(points(path) == 1);
    CHECK(log.contains("the points are those of"));
  }
  const LogCapture log;
  CHECK(points("/home/u/fox/other.ply") == 0);
  CHECK(log.contains("names the points /home/u/fox/other.ply, which are not there"));
}

TEST_CASE("photos are found where marks are characters of their own in one of the names") {
  // U+00E4 against an a with U+0308 behind it, and likewise U+0161; the folder as well.
  const std::string composed = "f\xC3\xB6to/B\xC3\xA4r \xC5\xA1 0.png";
  const std::string decomposed = "fo\xCC\x88to/Ba\xCC\x88r s\xCC\x8C 0.png";
  for (const bool is_composed : {true, false}) {
    CAPTURE(is_composed);
    const Scratch scratch;
    write_scene(scratch, {is_composed ? composed : decomposed},
                {is_composed ? decomposed : composed});
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 1);
    CHECK(log.contains("how accents are written"));
  }
  // Without any mark it is another name.
  const Scratch scratch;
  write_scene(scratch, {"Bar.png"}, {"B\xC3\xA4r.png"});
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "do not exist"));
}

TEST_CASE("two frames whose paths end alike are refused where one photo stands for both") {
  const Scratch scratch;
  write_scene(scratch, {"cam0/a.png", "cam1/a.png", "cam0/b.png"},
              {"images/a.png", "images/b.png"});
  const std::string message = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(message, "'cam0/a.png' and 'cam1/a.png'"));
  CHECK(contains(message, "are both the file"));
  // Those of the two files of a Blender data set as well.
  const Scratch blender;
  write_scene(blender, {"train/a.png"}, {"a.png"});
  fs::rename(blender / "transforms.json", blender / "transforms_train.json");
  write_scene(blender, {"test/a.png"}, {});
  fs::rename(blender / "transforms.json", blender / "transforms_test.json");
  CHECK(contains(data_error([&] { load_dataset(blender.path()); }),
                 "'train/a.png' and 'test/a.png'"));
}

TEST_CASE("a photo of another frame is not taken for one that was deleted") {
  const Scratch scratch;
  write_scene(scratch, {"images/a.png", "images/b.png", "images/c.png", "old/a.png"},
              {"images/a.png", "images/b.png", "images/c.png"});
  CHECK(load_dataset(scratch.path()).views.size() == 3);
  // Two spellings of one path are one photo in two frames.
  const Scratch twice;
  write_scene(twice, {"/old/s/images/a.png", "./images/a.png"}, {"images/a.png"});
  CHECK(load_dataset(twice.path()).views.size() == 2);
}

TEST_CASE("terms of a lens that no camera here has are refused by name") {
  const auto with = [](const std::string& keys) {
    return cameras_error(file_of(kKeys + keys, frame_with(matrix_json(1))));
  };
  CHECK(contains(with("\"k1\": 0.1, \"k5\": 0.01, "), "'k5' is a term of a lens"));
  CHECK(contains(with("\"k6\": \"-1e-3\", "), "'k6' is a term of a lens"));
  CHECK(with("\"k5\": 0, \"k6\": 0.0, ").empty());
}

TEST_CASE("cameras.json of trainers of 3DGS is read as cameras without lenses") {
  const std::string pose =
      "\"width\": 40, \"height\": 30, \"position\": [1, 2, 3], \"rotation\": [[0.8, 0, 0.6], "
      "[0, 1, 0], [-0.6, 0, 0.8]]";
  const auto cameras = cameras_of("\n [{\"id\": 0, \"img_name\": \"00001\", " + pose +
                                  ", \"fy\": 51, \"fx\": 50}, {\"id\": 1, " + pose + "}]");
  REQUIRE(cameras.size() == 2);
  CHECK(cameras[0].name == "00001");
  CHECK(cameras[0].model == CameraModel::kPinhole);
  CHECK(cameras[0].fx == 50);
  CHECK(cameras[0].fy == 51);
  CHECK(cameras[0].cx == 20);
  CHECK(cameras[0].cy == 15);
  CHECK(glm::length(cameras[0].center() - glm::dvec3(1, 2, 3)) < 1e-12);
  // The columns of its matrix are right, down and forward.
  CHECK(glm::length(cameras[0].rotation * glm::dvec3(0.6, 0, 0.8) - glm::dvec3(0, 0, 1)) < 1e-12);
  // Without focal lengths: a panorama.
  CHECK(cameras[1].name == "frame_0001");
  CHECK(cameras[1].model == CameraModel::kEquirectangular);
  CHECK(cameras[1].fx == 20);
  CHECK(cameras[1].fy == 30);
  // As editors of Windows save it.
  CHECK(cameras_of("\xEF\xBB\xBF[{" + pose + ", \"fx\": 50, \"fy\": 50}]").size() == 1);
  CHECK(contains(cameras_error("\xEF\xBB\xBF[]"), "lists no cameras"));
  CHECK(contains(cameras_error("[]"), "lists no cameras"));
  CHECK(contains(cameras_error("[{" + pose + "}, 3]"), "entry 1 is no view"));
  CHECK(contains(cameras_error("[{"), "no valid JSON"));
  std::string far = pose;
  far.replace(far.find("[1, 2"), 5, "[1e30, 2");
  CHECK(contains(cameras_error("[{" + far + "}]"), "from the origin"));
}
