// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "io/dataset/colmap_model.hpp"
#include "raysplats/dataset.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

std::string model_error(const fs::path& folder) {
  const std::string message = data_error([&] { io::read_colmap_model(folder); });
  CHECK(message.find('\n') == std::string::npos);
  return message;
}

/// The error of a binary model one file of which has been replaced.
std::string error_with(const char* file, const std::string& content) {
  const Scratch scratch;
  small_colmap().write_binary(scratch.path());
  write_bytes(scratch / file, content);
  const std::string message = model_error(scratch.path());
  CHECK(contains(message, file));
  return message;
}

std::string text_error_with(const char* file, const std::string& content) {
  const Scratch scratch;
  small_colmap().write_text(scratch.path());
  write_bytes(scratch / file, content);
  const std::string message = model_error(scratch.path());
  CHECK(contains(message, file));
  return message;
}

}  // namespace

TEST_CASE("binary and text COLMAP models of the same scene give the same data set") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "binary/sparse/0");
  fixture.write_text(scratch / "text/sparse");
  write_photos(fixture, scratch / "binary/images", 40, 30);
  write_photos(fixture, scratch / "text/images", 40, 30);
  const Dataset a = load_dataset(scratch / "binary");
  const Dataset b = load_dataset(scratch / "text");
  CHECK(a.kind == DatasetKind::kColmap);
  CHECK(!a.alpha_is_background);
  REQUIRE(a.views.size() == 10);
  REQUIRE(b.views.size() == 10);
  for (std::size_t i = 0; i < 10; ++i) {
    const Camera& x = a.views[i].camera;
    const Camera& y = b.views[i].camera;
    CHECK(x.name == y.name);
    CHECK(x.fx == y.fx);
    CHECK(x.fy == y.fy);
    CHECK(x.cx == y.cx);
    CHECK(x.cy == y.cy);
    CHECK(x.rotation == y.rotation);
    CHECK(x.translation == y.translation);
    CHECK(x.model == CameraModel::kPinhole);
    CHECK(!x.distortion.any());
    CHECK(a.views[i].source_camera.model == b.views[i].source_camera.model);
    CHECK(a.views[i].source_camera.distortion.k1 == b.views[i].source_camera.distortion.k1);
    CHECK(a.views[i].source_camera.distortion.p2 == b.views[i].source_camera.distortion.p2);
    CHECK(a.views[i].test == (i % 8 == 0));
    if (i > 0) CHECK(a.views[i - 1].camera.name < x.name);
  }
  CHECK(a.views[0].camera.name == "left/photo 1.png");
  CHECK(a.views[9].camera.name == "photo 8.png");
  CHECK(a.points.positions == std::vector<float>{1, 2, 3, -1.5f, 0, 8, 0.125f, 4, 5});
  CHECK(a.points.positions == b.points.positions);
  CHECK(a.points.colors == b.points.colors);
  CHECK(a.points.colors[2] == doctest::Approx(0.2));
  CHECK(a.indices(Split::kTest) == std::vector<std::size_t>{0, 8});
  CHECK(a.indices(Split::kTrain).size() == 8);
  CHECK(a.indices(Split::kAll).size() == 10);
}

TEST_CASE("COLMAP poses and lens parameters mean what COLMAP documents") {
  const Scratch scratch;
  ColmapFixture fixture;
  const double h = std::sqrt(0.5);
  // A quarter turn about z: world x goes to camera y, world y to camera -x.
  fixture.images = {{1, {h, 0, 0, h, 10, 20, 30}, 1, "a.png", 0}};
  fixture.points = {{{0, 0, 1}, {0, 0, 0}}};
  struct Case {
    int model;
    const char* name;
    std::vector<double> parameters;
    double fx, fy, cx, cy;
    Distortion d;
    CameraModel lens = CameraModel::kPinhole;
  };
  constexpr CameraModel kOpenCv = CameraModel::kOpenCv;
  constexpr CameraModel kFisheye = CameraModel::kFisheye;
  for (const Case& c :
       {Case{0, "SIMPLE_PINHOLE", {50, 21, 16}, 50, 50, 21, 16, {}},
        Case{1, "PINHOLE", {50, 51, 21, 16}, 50, 51, 21, 16, {}},
        Case{2, "SIMPLE_RADIAL", {50, 21, 16, 0}, 50, 50, 21, 16, {}},
        Case{2, "SIMPLE_RADIAL", {50, 21, 16, 0.1}, 50, 50, 21, 16, {0.1, 0, 0, 0, 0}, kOpenCv},
        Case{3, "RADIAL", {50, 21, 16, 0.1, 0.2}, 50, 50, 21, 16, {0.1, 0.2, 0, 0, 0}, kOpenCv},
        Case{5,
             "OPENCV_FISHEYE",
             {50, 51, 21, 16, 0.1, 0.2, 0.3, 0.4},
             50,
             51,
             21,
             16,
             {0.1, 0.2, 0.3, 0, 0, 0.4},
             kFisheye},
        Case{6,
             "FULL_OPENCV",
             {50, 51, 21, 16, 0.1, 0.2, 0.3, 0.4, 0.5, 0, 0, 0},
             50,
             51,
             21,
             16,
             {0.1, 0.2, 0.5, 0.3, 0.4},
             kOpenCv},
        Case{8,
             "SIMPLE_RADIAL_FISHEYE",
             {50, 21, 16, 0.1},
             50,
             50,
             21,
             16,
             {0.1, 0, 0, 0, 0},
             kFisheye},
        Case{9,
             "RADIAL_FISHEYE",
             {50, 21, 16, 0.1, 0.2},
             50,
             50,
             21,
             16,
             {0.1, 0.2, 0, 0, 0},
             kFisheye},
        Case{14, "SIMPLE_FISHEYE", {50, 21, 16}, 50, 50, 21, 16, {}, kFisheye},
        Case{15, "FISHEYE", {50, 51, 21, 16}, 50, 51, 21, 16, {}, kFisheye},
        Case{4,
             "OPENCV",
             {50, 51, 21, 16, 0.1, 0.2, 0.3, 0.4},
             50,
             51,
             21,
             16,
             {0.1, 0.2, 0, 0.3, 0.4},
             kOpenCv}}) {
    CAPTURE(c.name);
    fixture.cameras = {{1, c.model, c.name, 40, 30, c.parameters}};
    fixture.write_binary(scratch / c.name);
    const io::ColmapModel model = io::read_colmap_model(scratch / c.name);
    const Camera& camera = model.cameras.at(1);
    CHECK(camera.model == c.lens);
    CHECK(camera.fx == c.fx);
    CHECK(camera.fy == c.fy);
    CHECK(camera.cx == c.cx);
    CHECK(camera.cy == c.cy);
    CHECK(camera.distortion.k3 == c.d.k3);
    CHECK(camera.distortion.k4 == c.d.k4);
    CHECK(camera.distortion.k1 == c.d.k1);
    CHECK(camera.distortion.k2 == c.d.k2);
    CHECK(camera.distortion.p1 == c.d.p1);
    CHECK(camera.distortion.p2 == c.d.p2);
    const io::ColmapImage& image = model.images.front();
    CHECK(glm::length(image.rotation * glm::dvec3(1, 0, 0) - glm::dvec3(0, 1, 0)) < 1e-12);
    CHECK(glm::length(image.rotation * glm::dvec3(0, 1, 0) - glm::dvec3(-1, 0, 0)) < 1e-12);
    CHECK(image.translation == glm::dvec3(10, 20, 30));
  }
}

TEST_CASE("cameras stay what they are where photos are not undistorted, and fisheyes always") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  fixture.cameras[0] = {7, 5, "OPENCV_FISHEYE", 40, 30, {18, 19, 20, 15, 0.05, -0.01, 0, 0.001}};
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  DatasetOptions options;
  options.downscale = 2;
  const auto count = [](const Dataset& dataset, CameraModel model) {
    return std::count_if(dataset.views.begin(), dataset.views.end(),
                         [&](const View& view) { return view.camera.model == model; });
  };
  const Dataset undistorted = load_dataset(scratch.path(), options);
  CHECK(count(undistorted, CameraModel::kPinhole) == 6);
  CHECK(count(undistorted, CameraModel::kFisheye) == 4);
  options.undistort = false;
  const Dataset kept = load_dataset(scratch.path(), options);
  CHECK(count(kept, CameraModel::kOpenCv) == 6);
  CHECK(count(kept, CameraModel::kFisheye) == 4);
  for (std::size_t i = 0; i < kept.views.size(); ++i) {
    const View& view = kept.views[i];
    CHECK(view.camera.distortion.k1 == view.source_camera.distortion.k1);
    CHECK(view.camera.distortion.any());
    CHECK(view.camera.width == 20);
    CHECK(view.camera.fx == view.source_camera.fx / 2);
    const Image image = load_view_image(view);
    CHECK(image.width == 20);
    // A grey photo stays grey to its corners, which an undistorted one does not reach.
    CHECK(image.at(0, 0, 3) == 1.0f);
    CHECK(image.at(0, 0, 0) == doctest::Approx(0.2).epsilon(0.01));
    CHECK(undistorted.views[i].source_camera.model == view.source_camera.model);
  }
}

TEST_CASE("photos of another size scale the camera, and images_N and --downscale add up") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  fixture.cameras.resize(1);
  for (auto& image : fixture.images) image.camera = 7;
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images_4", 10, 8);  // 30 / 4 = 7.5
  const auto load = [&](double downscale) {
    DatasetOptions options;
    options.downscale = downscale;
    return load_dataset(scratch.path(), options);
  };
  for (const double downscale : {1.0, 2.0, 4.0}) {
    const View view = load(downscale).views.front();
    CHECK(view.camera.width == 10);
    CHECK(view.camera.height == 8);
    CHECK(view.camera.fx == doctest::Approx(50.5 / 4));
    CHECK(view.camera.fy == doctest::Approx(51.25 * 8 / 30));
    CHECK(view.camera.cy == doctest::Approx(14.75 * 8 / 30));
    CHECK(load_view_image(view).width == 10);
  }
  CHECK(load(8).views.front().camera.width == 5);
  CHECK(load(8).views.front().camera.height == 4);
  CHECK(load_view_image(load(8).views.front()).height == 4);
  // The full size, once there, is used for every factor but 4.
  write_photos(fixture, scratch / "images", 40, 30);
  CHECK(load(1).views.front().camera.width == 40);
  CHECK(load(2).views.front().camera.width == 20);
  CHECK(contains(load(2).views.front().image_path.string(), "images/"));
  CHECK(contains(load(4).views.front().image_path.string(), "images_4/"));
  CHECK(load(3).views.front().camera.width == 13);
  CHECK_THROWS_AS(load(0.5), UsageError);
  CHECK_THROWS_AS(load(std::numeric_limits<double>::quiet_NaN()), UsageError);
}

TEST_CASE("of several COLMAP models the one with most images is used, in any documented place") {
  const Scratch scratch;
  const ColmapFixture all = small_colmap();
  ColmapFixture part = all;
  part.images.resize(4);
  part.write_binary(scratch / "sparse/0");
  all.write_text(scratch / "sparse/1");
  part.write_binary(scratch / "sparse/2");
  CHECK(io::find_colmap_model(scratch.path())->filename() == "1");
  all.write_text(scratch / "sparse/0");  // binary files are preferred
  CHECK(io::find_colmap_model(scratch.path())->filename() == "1");
  for (const char* place : {"colmap/sparse/0", "colmap/sparse", "."}) {
    const Scratch other;
    all.write_binary(other / place);
    CHECK(fs::equivalent(*io::find_colmap_model(other.path()), other / place));
  }
  const Scratch empty;
  CHECK(!io::find_colmap_model(empty.path()));
}

TEST_CASE("folders of 3DGS's convert.py: the photos in input or in images that the model is of") {
  const Scratch scratch;
  ColmapFixture distorted = small_colmap();
  distorted.images.resize(6);
  ColmapFixture flat = distorted;
  for (auto& camera : flat.cameras) camera = {camera.id, 1, "PINHOLE", 42, 31, {47, 46, 21, 15.5}};
  const auto folder_of = [&] {
    const View view = load_dataset(scratch.path()).views.front();
    CHECK(contains(view.image_path.string(), view.camera.name));
    return view.image_path.lexically_relative(scratch.path()).begin()->string();
  };
  const auto refused = [&] { return data_error([&] { load_dataset(scratch.path()); }); };
  // Not run: photos alone.
  write_photos(distorted, scratch / "input", 40, 30);
  CHECK(contains(refused(), "raysplats prepare " + (scratch / "input").string()));
  // Interrupted before undistortion.
  distorted.write_binary(scratch / "distorted/sparse/0");
  CHECK(folder_of() == "input");
  // Undistorted: another model, of other photos.
  flat.write_binary(scratch / "sparse/0");
  write_photos(flat, scratch / "images", 42, 31);
  CHECK(folder_of() == "images");
  CHECK(load_dataset(scratch.path()).views.front().camera.width == 42);
  write_photos(flat, scratch / "images_2", 21, 16);
  DatasetOptions half;
  half.downscale = 2;
  CHECK(contains(load_dataset(scratch.path(), half).views.front().image_path.string(), "images_2"));
  // A model of the photos in input beside photos of another size.
  distorted.write_binary(scratch / "sparse/0");
  CHECK(folder_of() == "input");
  // The same sizes in both: images, as ever, also where a photo was deleted from it.
  write_photos(distorted, scratch / "images", 40, 30);
  CHECK(folder_of() == "images");
  fs::remove(scratch / "images" / distorted.images[2].name);
  CHECK(folder_of() == "images");
  CHECK(load_dataset(scratch.path()).views.size() == 5);
  for (const int i : {0, 1, 3}) fs::remove(scratch / "images" / distorted.images[i].name);
  CHECK(folder_of() == "input");
  fs::remove_all(scratch / "images");
  fs::remove_all(scratch / "images_2");
  CHECK(folder_of() == "input");
}

TEST_CASE("masks beside the photos and test_every are honoured") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  Image mask(40, 30, 1, 1.0f);
  mask.at(3, 4, 0) = 0.0f;
  write_image(scratch / "masks/photo 8.png", mask);
  DatasetOptions options;
  options.test_every = 3;
  const Dataset dataset = load_dataset(scratch.path(), options);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{0, 3, 6, 9});
  CHECK(dataset.test_every == 3);
  CHECK(dataset.views[9].camera.name == "photo 8.png");
  const View& masked = dataset.views[9];
  REQUIRE(!masked.mask_path.empty());
  CHECK(dataset.views[8].mask_path.empty());
  if (!masked.source_camera.distortion.any()) CHECK(load_view_image(masked).at(3, 4, 3) == 0.0f);
  options.test_every = 0;
  CHECK(load_dataset(scratch.path(), options).indices(Split::kTest).empty());
  options.test_every = -1;
  CHECK_THROWS_AS(load_dataset(scratch.path(), options), UsageError);
}

TEST_CASE("masks are found under the names that programs give them, or their absence is told") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  for (const char* name :
       {"photo 8.png.png", "photo 8.PNG", "photo 8.jpeg", "photo 8_mask.png", "photo 8.mask.png"}) {
    CAPTURE(name);
    fs::remove_all(scratch / "masks");
    write_image(scratch / "masks/m.png", Image(40, 30, 1, 1.0f));
    const std::string extension = fs::path(name).extension().string();
    if (extension == ".jpeg") write_image(scratch / "masks/m.jpg", Image(40, 30, 3, 1.0f));
    fs::rename(scratch / (extension == ".jpeg" ? "masks/m.jpg" : "masks/m.png"),
               scratch / "masks" / name);
    const LogCapture log;
    CHECK(!load_dataset(scratch.path()).views[9].mask_path.empty());
    CHECK(!log.contains("No mask"));
  }
  fs::rename(scratch / "masks/photo 8.mask.png", scratch / "masks/other.png");
  const LogCapture log;
  load_dataset(scratch.path());
  CHECK(log.contains("No mask"));
}

TEST_CASE("images that would share a photo, and photos of nearly another size") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  {
    const LogCapture log;
    load_dataset(scratch.path());
    CHECK(!log.contains("stretched"));
  }
  for (const ColmapFixture::ImageLine& image : fixture.images)
    write_image(scratch / "images" / image.name, Image(44, 33, 3));
  {
    const LogCapture log;
    load_dataset(scratch.path());
    CHECK(log.contains("stretched"));
  }
  fixture.images[0].name = "a/one.png", fixture.images[1].name = "b/one.png";
  fixture.write_binary(scratch / "sparse/0");
  write_image(scratch / "images/one.png", Image(40, 30, 3));
  const std::string shared = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(shared, "a/one.png"));
  CHECK(contains(shared, "b/one.png"));
}

TEST_CASE("nerfstudio's file goes before the COLMAP model that it was made from") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "colmap/sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  const auto write_file = [&](const std::string& points) {
    write_bytes(scratch / "transforms.json",
                "{" + points +
                    "\"fl_x\": 40, \"frames\": [{\"file_path\": \"images/photo 8.png\", "
                    "\"transform_matrix\": " +
                    matrix_json(1) + "}]}");
  };
  write_file("");
  {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).kind == DatasetKind::kColmap);
    CHECK(log.contains("beside it is not"));
  }
  write_bytes(scratch / "points.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\nend_header\n1 2 3\n");
  write_file("\"ply_file_path\": \"points.ply\", ");
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).kind == DatasetKind::kNerfstudio);
  CHECK(log.contains("is read, not the COLMAP model"));
}

TEST_CASE("text with a byte order mark is read, and images without their points are refused") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_text(scratch.path());
  const std::string cameras = read_bytes(scratch / "cameras.txt");
  write_bytes(scratch / "cameras.txt", "\xEF\xBB\xBF" + cameras);
  const std::size_t images = io::read_colmap_model(scratch.path()).images.size();
  CHECK(images == fixture.images.size());
  CHECK(
      contains(text_error_with("images.txt", "1 1 0 0 0 0 0 0 1 a.png\n2 1 0 0 0 0 0 0 1 b.png\n"),
               "the points of image 'a.png'"));
  // A name of three words makes the number of words one of whole points.
  CHECK(contains(text_error_with("images.txt",
                                 "1 1 0 0 0 0 0 0 1 My photo a.png\n"
                                 "2 1 0 0 0 0 0 0 1 My photo b.png\n"),
                 "the points of image 'My photo a.png'"));
}

TEST_CASE("points of a COLMAP model may be a PLY where the model has no others") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch.path());
  write_bytes(scratch / "points3D.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\nend_header\n1 2 3\n");
  CHECK(io::read_colmap_model(scratch.path()).points.size() == fixture.points.size());
  fs::remove(scratch / "points3D.bin");
  {
    const LogCapture log;
    const io::ColmapModel model = io::read_colmap_model(scratch.path());
    CHECK(model.points.positions == std::vector<float>{1, 2, 3});
    CHECK(model.positions == std::vector<double>{1, 2, 3});
    CHECK(log.contains("points3D.ply"));
  }
  fs::remove(scratch / "points3D.ply");
  const LogCapture log;
  CHECK(io::read_colmap_model(scratch.path()).points.size() == 0);
  CHECK(log.contains("no points to start from"));
}

TEST_CASE("points of a COLMAP model that are not finite are left out, which is told") {
  ColmapFixture fixture = small_colmap();
  fixture.points[0].position[2] = std::numeric_limits<double>::quiet_NaN();
  fixture.points[1].position[0] = 1e300;  // beyond a float
  for (const bool binary : {true, false}) {
    CAPTURE(binary);
    const Scratch scratch;
    binary ? fixture.write_binary(scratch / "sparse/0") : fixture.write_text(scratch / "sparse/0");
    if (!binary) {
      // Every image shows the points of its own track.
      write_bytes(scratch / "sparse/0/points3D.txt",
                  "1 nan 2 3 1 2 3 0.5 100 0 99 0\n2 1e300 2 3 1 2 3 0.5 100 1\n"
                  "3 0.125 4 5 1 2 3 0.25 99 1 98 0 97 0\n");
    }
    write_photos(fixture, scratch / "images", 40, 30);
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    CHECK(log.contains("2 of 3 points have a coordinate that is not finite and are left out"));
    CHECK(dataset.points.positions == std::vector<float>{0.125f, 4, 5});
    CHECK(dataset.points.colors.size() == 3);
    CHECK(dataset.points.track_lengths == std::vector<std::uint32_t>{binary ? 2u : 3u});
    CHECK(dataset.points.errors.size() == 1);
    if (binary) continue;
    const io::ColmapModel model = io::read_colmap_model(scratch / "sparse/0");
    for (const io::ColmapImage& image : model.images) {
      const bool shows = image.id >= 97 && image.id <= 99;
      CHECK(image.points == std::vector<std::uint32_t>(shows ? 1 : 0, 0));
    }
  }
}

TEST_CASE("a data set without its photos, with foreign photos or without anything is refused") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  for (const char* name : {"left/photo 5.png", "photo 0.png", "photo 2.png", "photo 4.png"})
    fs::remove(scratch / "images" / name);
  {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 6);
    CHECK(log.contains("4 of 10 images"));
    CHECK(log.contains("'left/photo 5.png' among them: they are left out"));
  }
  for (const char* name : {"photo 6.png", "photo 8.png"}) fs::remove(scratch / "images" / name);
  const std::string missing = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(missing, "6 of 10 images"));
  CHECK(contains(missing, "'left/photo 5.png' among them: put them there"));
  write_photos(fixture, scratch / "images", 40, 30);
  write_image(scratch / "images/left/photo 5.png", Image(30, 40, 3));
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "30 x 40"));
  write_bytes(scratch / "images/left/photo 5.png", "");
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "empty"));
  const Scratch empty;
  CHECK(contains(data_error([&] { load_dataset(empty.path()); }), "no data set"));
  CHECK(contains(data_error([&] { load_dataset(empty / "none"); }), "does not exist"));
  // A folder in a folder.
  fixture.write_binary(empty / "garden/sparse/0");
  CHECK(contains(data_error([&] { load_dataset(empty.path()); }),
                 "; " + (empty / "garden").string() + " is one"));
  write_bytes(empty / "file", "");
  CHECK(contains(data_error([&] { load_dataset(empty / "file"); }), "is a file"));
  ColmapFixture nothing = fixture;
  nothing.images.clear();
  nothing.write_binary(empty / "sparse");
  CHECK(contains(data_error([&] { load_dataset(empty.path()); }), "no views"));
}

TEST_CASE("a photo that changed after the data set was opened is refused") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  const View view = load_dataset(scratch.path()).views.front();
  write_image(view.image_path, Image(20, 15, 3));
  CHECK(contains(data_error([&] { load_view_image(view); }), "20 x 15"));
}

TEST_CASE("malformed COLMAP models are refused with the place of the fault") {
  ColmapFixture fixture = small_colmap();
  fixture.cameras[0].model = 77;
  CHECK(contains(error_with("cameras.bin", fixture.cameras_binary()), "number 77"));
  fixture = small_colmap();
  fixture.cameras[1].model_name = "MEI";
  CHECK(contains(text_error_with("cameras.txt", fixture.cameras_text()), "'MEI' is not known"));
  CHECK(contains(text_error_with("cameras.txt", "7 PINHOLE 40 30 1 2 3\n"),
                 "parameter is missing in line 1"));
  CHECK(contains(text_error_with("cameras.txt", "\n7 PINHOLE 40 30 1 2 3 4 4\n"),
                 "PINHOLE has 4 parameters and '4' follows them in line 2"));
  CHECK(contains(text_error_with("cameras.txt", "7 PINHOLE -40 30 1 2 3 4\n"), "'-40'"));
  CHECK(contains(text_error_with("cameras.txt", "7 PINHOLE 40 30 1 nan 3 4\n"), "not finite"));
  fixture.cameras[1].parameters[0] = -1;
  CHECK(contains(error_with("cameras.bin", fixture.cameras_binary()), "not positive"));
  fixture = small_colmap();
  fixture.cameras[0].width = std::uint64_t{1} << 40;
  CHECK(contains(error_with("cameras.bin", fixture.cameras_binary()), "impossible size"));
  fixture = small_colmap();
  fixture.cameras[1].id = 7;
  CHECK(contains(error_with("cameras.bin", fixture.cameras_binary()), "appears twice"));
  fixture = small_colmap();
  fixture.images[2].pose[1] = std::numeric_limits<double>::quiet_NaN();
  CHECK(contains(error_with("images.bin", fixture.images_binary()), "not finite"));
  fixture.images[2].pose = {0, 0, 0, 0, 1, 2, 3};
  CHECK(contains(error_with("images.bin", fixture.images_binary()), "rotation"));
  fixture = small_colmap();
  fixture.images[2].camera = 123;
  CHECK(contains(error_with("images.bin", fixture.images_binary()), "camera 123"));
  fixture = small_colmap();
  fixture.images[2].name = fixture.images[1].name;
  CHECK(contains(error_with("images.bin", fixture.images_binary()), "appears twice"));
  CHECK(contains(text_error_with("points3D.txt", "1 2 3\n"), "in line 1"));
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    CHECK(contains(error_with(file, std::string(8, '\xff')), "18446744073709551615"));
    std::string huge;
    put<std::uint64_t>(huge, std::uint64_t{1} << 61);
    CHECK(contains(error_with(file, huge + std::string(100, 'x')), "bytes can hold"));
  }
}

TEST_CASE("no cut or flipped byte of a COLMAP model does anything but load or raise DataError") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch.path());
  CounterRng rng(8, 9);
  for (const auto& [file, whole] :
       {std::pair<const char*, std::string>{"cameras.bin", fixture.cameras_binary()},
        {"images.bin", fixture.images_binary()},
        {"points3D.bin", fixture.points_binary()}}) {
    for (std::size_t length = 0; length < whole.size(); ++length) {
      write_bytes(scratch / file, whole.substr(0, length));
      CHECK(model_error(scratch.path()) != "");
    }
    for (int trial = 0; trial < 500; ++trial) {
      std::string bytes = whole;
      for (int i = 0; i < 3; ++i)
        bytes[rng.below(bytes.size())] = static_cast<char>(rng.below(256));
      write_bytes(scratch / file, bytes);
      model_error(scratch.path());
    }
    write_bytes(scratch / file, whole);
  }
}
