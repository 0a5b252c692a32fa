// SPDX-License-Identifier: Apache-2.0
// Data sets of camera files: the photos, masks, points and test views that Blender's and
// nerfstudio's name.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cmath>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "unit/io/transforms_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE(
    "paths of another machine are found by their ends, masks and depth maps in their folders") {
  const Scratch scratch;
  const Image photo(20, 10, 3, 0.5f);
  write_image(scratch / "images/left eye/ä 1.png", photo);
  write_image(scratch / "images/2.png", photo);
  write_image(scratch / "3.png", photo);
  write_image(scratch / "masks/2.png", Image(20, 10, 1, 1.0f));
  write_bytes(scratch / "transforms.json",
              file_of("\"w\": 20, \"h\": 10, \"fl_x\": 20, \"train_filenames\": [\"C:/a/2.png\"], ",
                      frame(R"(C:\\Users\\me\\fox\\images\\left eye\\ä 1.png)", 1) + "," +
                          frame("C:/a/2.png", 2, "\"mask_path\": \"/home/me/fox/masks/2.png\", ") +
                          "," + frame("/home/me/images/3.png", 3)));
  const LogCapture log;
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(log.contains("3 of 3 photos are not where"));
  REQUIRE(dataset.views.size() == 3);
  const View* second = nullptr;
  for (const View& view : dataset.views) {
    CHECK(view.test == (view.camera.name != "images/2.png"));
    if (!view.test) second = &view;
  }
  REQUIRE(second != nullptr);
  CHECK(fs::equivalent(second->mask_path, scratch / "masks/2.png"));
  CHECK(dataset.indices(Split::kTest).size() == 2);
  CHECK(fs::equivalent(dataset.views.front().image_path, scratch / "3.png"));
  fs::remove(scratch / "images/2.png");
  fs::remove(scratch / "3.png");
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "'C:/a/2.png' of frame 1"));
}

TEST_CASE("Blender scenes have their own test views, straight alpha and no size in the file") {
  const Scratch scratch;
  Image photo(20, 10, 4, 0.5f);
  for (const char* name :
       {"train/r_0.png", "train/r_1.png", "train/r_10.png", "test/r_0.png", "val/r_0.png"}) {
    write_image(scratch / name, photo);
  }
  write_bytes(scratch / "transforms_train.json",
              file_of("\"camera_angle_x\": 0.8, ", frame("./train/r_10", 1) + "," +
                                                       frame("./train/r_0", 2) + "," +
                                                       frame("./train/r_1", 3)));
  write_bytes(scratch / "transforms_val.json",
              file_of("\"camera_angle_x\": 0.8, ", frame("./val/r_0", 4)));
  const auto load = [&] { return load_dataset(scratch.path()); };
  CHECK(load().views.size() == 4);
  CHECK(load().views.back().camera.name == "val/r_0.png");
  CHECK(load().views.back().test);
  write_bytes(scratch / "transforms_test.json",
              file_of("\"camera_angle_x\": 0.8, ", frame("./test/r_0", 4)));
  const Dataset dataset = load();
  CHECK(dataset.kind == DatasetKind::kBlender);
  CHECK(dataset.alpha_is_background);
  REQUIRE(dataset.views.size() == 4);
  CHECK(dataset.views[0].camera.name == "train/r_0.png");
  CHECK(dataset.views[2].camera.name == "train/r_10.png");
  CHECK(dataset.views[3].camera.name == "test/r_0.png");
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{3});
  CHECK(dataset.views[0].camera.fx == doctest::Approx(10 / std::tan(0.4)));
  CHECK(dataset.views[0].camera.cy == 5);
  const Image image = load_view_image(dataset.views[0]);
  CHECK(image.channels == 4);
  CHECK(image.at(3, 3, 0) == doctest::Approx(128.0 / 255));
  CHECK(image.at(3, 3, 3) == doctest::Approx(128.0 / 255));
}

TEST_CASE("masks of cut-out photos ignore pixels or cut them out, and bad masks are refused") {
  const Scratch scratch;
  // The right half is transparent; the mask ignores the upper half, in quarters of the photo's
  // size.
  Image photo(16, 8, 4, 1.0f);
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 16; ++x) {
      photo.at(x, y, 0) = y < 4 ? 0.0f : 1.0f;
      photo.at(x, y, 3) = x < 8 ? 1.0f : 0.0f;
    }
  }
  Image mask(8, 4, 1, 1.0f);
  for (int x = 0; x < 8; ++x) mask.at(x, 0, 0) = mask.at(x, 1, 0) = 0.0f;
  write_image(scratch / "train/r_0.png", photo);
  write_image(scratch / "test/r_0.png", photo);
  write_image(scratch / "masks/train/r_0.png", mask);
  for (const char* split : {"train", "test"}) {
    write_bytes(scratch / (std::string("transforms_") + split + ".json"),
                file_of("\"camera_angle_x\": 0.8, ", frame(std::string(split) + "/r_0", 0, "")));
  }
  DatasetOptions options;
  const Dataset ignored = load_dataset(scratch.path(), options);
  REQUIRE(ignored.views.size() == 2);
  CHECK(ignored.views[0].mask_apart);
  CHECK(ignored.views[1].mask_path.empty());
  CHECK(load_view_picture(ignored.views[1]).weight.data.empty());
  const ViewPicture whole = load_view_picture(ignored.views[0]);
  CHECK(whole.weight.at(3, 3, 0) == 0.0f);
  CHECK(whole.weight.at(3, 4, 0) == 1.0f);
  CHECK(whole.rgba.at(3, 4, 3) == 1.0f);
  CHECK(whole.rgba.at(12, 4, 3) == 0.0f);
  CHECK(load_view_image(ignored.views[0]).data == whole.rgba.data);
  // Reduced so that a pixel has three rows that are ignored and one that counts.
  View small = ignored.views[0];
  small.camera = downscaled(small.camera, 16.0 / 3.0);
  small.camera.height = 1;
  const ViewPicture reduced = load_view_picture(small);
  CHECK(reduced.weight.at(0, 0, 0) == doctest::Approx(0.5));
  CHECK(reduced.rgba.at(0, 0, 3) == doctest::Approx(1.0));
  CHECK(reduced.rgba.at(0, 0, 0) == doctest::Approx(1.0));

  options.masks = MaskUse::kCutout;
  const Dataset cut = load_dataset(scratch.path(), options);
  CHECK(cut.alpha_is_background);
  CHECK(!cut.views[0].mask_apart);
  CHECK(load_view_picture(cut.views[0]).weight.data.empty());
  CHECK(load_view_image(cut.views[0]).at(3, 3, 3) == 0.0f);
  CHECK(load_view_image(cut.views[0]).at(3, 4, 3) == 1.0f);

  write_image(scratch / "masks/train/r_0.png", Image(8, 8, 1, 1.0f));
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "another shape"));
  write_image(scratch / "masks/train/r_0.png", Image(16, 8, 1, 0.0f));
  const ViewPicture black = load_view_picture(load_dataset(scratch.path()).views[0]);
  CHECK(black.weight.data == std::vector<float>(16 * 8, 0.0f));
}

TEST_CASE("photos are found by names of Windows and extensions in capitals") {
  const Scratch scratch;
  for (const char* name : {"train/a.PNG", "train/b.png", "train/c.JPG"})
    write_image(scratch / name, Image(20, 10, 3, 0.5f));
  write_bytes(scratch / "transforms_train.json",
              file_of("\"camera_angle_x\": 0.8, ", frame("train\\\\a", 1) + "," +
                                                       frame(".\\\\train\\\\b.PNG", 2) + "," +
                                                       frame("train/c", 3)));
  const Dataset dataset = load_dataset(scratch.path());
  REQUIRE(dataset.views.size() == 3);
  CHECK(dataset.views[0].camera.name == "train/a.PNG");
  CHECK(dataset.views[1].image_path == scratch / "train/b.png");
  CHECK(dataset.views[1].camera.name == "train/b.PNG");
  CHECK(dataset.views[2].image_path == scratch / "train/c.JPG");
}

TEST_CASE("nerfstudio scenes: distortion, masks, points, lists of names, scaled photos") {
  const Scratch scratch;
  std::string frames;
  for (int i = 0; i < 9; ++i) {
    const std::string name = "images/f" + std::to_string(i) + ".png";
    write_image(scratch / name, Image(20, 10, 3, 0.5f));
    if (i > 0) frames += ",";
    frames += frame(name, i, i == 2 ? "\"mask_path\": \"m.png\", \"k1\": 0, " : "");
  }
  Image mask(10, 5, 1, 1.0f);
  mask.at(0, 0, 0) = 0.0f;
  write_image(scratch / "m.png", mask);
  write_bytes(scratch / "points.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\n"
              "end_header\n1 2 3\n");
  const std::string keys =
      "\"w\": 40, \"h\": 20, \"fl_x\": 50, \"fl_y\": 52, \"cx\": 21, \"cy\": 9, \"k1\": 0.1, "
      "\"k2\": 0.2, \"k3\": 0.3, "
      "\"p1\": 0.01, \"p2\": 0.02, \"camera_model\": \"OPENCV\", \"ply_file_path\": "
      "\"points.ply\", ";
  write_bytes(scratch / "transforms.json", file_of(keys, frames));
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(dataset.kind == DatasetKind::kNerfstudio);
  CHECK(!dataset.alpha_is_background);
  REQUIRE(dataset.views.size() == 9);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{0, 8});
  CHECK(dataset.points.positions == std::vector<float>{1, 2, 3});
  const View& view = dataset.views[1];
  CHECK(view.source_camera.model == CameraModel::kOpenCv);
  CHECK(view.source_camera.distortion.k1 == 0.1);
  CHECK(view.source_camera.distortion.k3 == 0.3);
  CHECK(view.source_camera.distortion.p2 == 0.02);
  CHECK(view.camera.model == CameraModel::kPinhole);
  CHECK(view.camera.width == 20);
  CHECK(view.camera.fx == 25);
  CHECK(view.camera.fy == 26);
  CHECK(view.camera.cx == 10.5);
  CHECK(view.camera.cy == 4.5);
  CHECK(dataset.views[2].source_camera.distortion.k1 == 0);
  CHECK(!dataset.views[2].mask_path.empty());
  View plain = dataset.views[2];
  plain.source_camera.model = CameraModel::kPinhole;
  const Image masked = load_view_image(plain);
  CHECK(masked.at(1, 1, 3) == 0.0f);
  CHECK(masked.at(2, 1, 3) == 1.0f);
  // The file's own lists: frames in neither are left out.
  write_bytes(
      scratch / "transforms.json",
      file_of(
          keys +
              "\"train_filenames\": [\"images/f3.png\", \"./images/f1.png\"], \"test_filenames\": "
              "[\"images/f7.png\"], ",
          frames));
  const Dataset lists = load_dataset(scratch.path());
  REQUIRE(lists.views.size() == 3);
  CHECK(lists.views[0].camera.name == "images/f1.png");
  CHECK(!lists.views[0].test);
  CHECK(lists.views[2].test);
  fs::remove(scratch / "m.png");
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "mask"));
}

TEST_CASE(
    "names in the lists of a nerfstudio file that are of no frame are told, and who is left") {
  const Scratch scratch;
  std::string frames;
  for (int i = 0; i < 4; ++i) {
    write_image(scratch / fmt::format("images/f{}.png", i), Image(10, 10, 3));
    if (i > 0) frames += ",";
    frames += frame(fmt::format("images/f{}.png", i), i);
  }
  const auto lists = [&](const std::string& train) {
    write_bytes(scratch / "transforms.json",
                file_of("\"w\": 10, \"h\": 10, \"fl_x\": 20, \"train_filenames\": [" + train +
                            "], \"test_filenames\": [\"images/f0.png\"], ",
                        frames));
  };
  lists("\"images/f1.png\", \"f2.png\"");
  {
    const LogCapture log;
    CHECK(load_dataset(scratch / "transforms.json").views.size() == 2);
    CHECK(log.contains("1 of 3 names"));
    CHECK(log.contains("'f2.png'"));
    CHECK(log.contains("2 of 4 frames"));
  }
  lists("\"images/f1.png\", \"images/f2.png\", \"images/f3.png\"");
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).views.size() == 4);
  CHECK(log.lines() == 0);
}

TEST_CASE("a photo that frames share is told, and measures nothing where it is trained on") {
  const Scratch scratch;
  for (const char* name : {"a.png", "b.png"}) write_image(scratch / name, Image(10, 10, 3));
  const auto write_frames = [&](const std::string& frames) {
    write_bytes(scratch / "transforms.json",
                file_of("\"w\": 10, \"h\": 10, \"fl_x\": 20, ", frames));
  };
  const auto loaded = [&](int test_every) {
    DatasetOptions options;
    options.test_every = test_every;
    return load_dataset(scratch.path(), options);
  };
  // The second names the file in another way.
  const std::string twice = frame("a.png", 0) + "," + frame("./a.png", 1);
  write_frames(twice);
  {
    const LogCapture log;
    CHECK(loaded(0).views.size() == 2);
    CHECK(log.contains("1 photo is in more than one frame"));
    CHECK(log.lines() == 1);
  }
  {
    const LogCapture log;
    CHECK(loaded(8).views.size() == 2);
    CHECK(log.contains("1 of 1 held-out photos are trained on as well"));
    CHECK(log.lines() == 1);
  }
  write_frames(twice + "," + frame("b.png", 2));
  const LogCapture log;
  const Dataset dataset = loaded(8);
  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{0});
  CHECK(dataset.views[1].camera.name == "b.png");
  CHECK(log.contains("1 of 2 photos to train on are held out too"));
  CHECK(log.lines() == 1);
}

TEST_CASE("points beside Blender's files are taken") {
  const Scratch scratch;
  write_image(scratch / "a.png", Image(10, 10, 3));
  write_bytes(scratch / "transforms_train.json", file_of("\"camera_angle_x\": 1, ", frame("a", 0)));
  CHECK(load_dataset(scratch.path()).points.size() == 0);
  write_bytes(scratch / "points3d.ply",
              "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float "
              "y\nproperty float z\nend_header\n1 2 3\n");
  CHECK(load_dataset(scratch.path()).points.size() == 1);
}
