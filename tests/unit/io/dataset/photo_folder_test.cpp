// SPDX-License-Identifier: Apache-2.0
// Where the photos of a COLMAP model are found.
#include "io/dataset/photo_folder.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <string>

#include "raysplats/dataset.hpp"
#include "unit/io/transforms_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("photos of a COLMAP model lie in folders of many names, which is told") {
  for (const char* name : {"Images", "image", "RGB", "color", "photos", "Input", "frames"}) {
    CAPTURE(name);
    const Scratch scratch;
    const ColmapFixture fixture = small_colmap();
    fixture.write_text(scratch / "sparse/0");
    write_photos(fixture, scratch / name, 40, 30);
    write_photos(fixture, scratch / "thumbnails", 40, 30);
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    CHECK(dataset.views.size() == 10);
    CHECK(log.contains("the photos of the model are those in"));
    for (const View& view : dataset.views)
      CHECK(contains(view.image_path.string(), std::string("/") + name + "/"));
  }
}

TEST_CASE("ScanNet++: the folder of the camera's photos is a data set with masks") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_text(scratch / "dslr/colmap");
  write_photos(fixture, scratch / "dslr/resized_images", 40, 30);
  write_image(scratch / "dslr/resized_anon_masks/photo 8.png", Image(40, 30, 1, 1.0f));
  write_bytes(scratch / "dslr/nerfstudio/transforms.json", "{}");
  const Dataset dataset = load_dataset(scratch / "dslr");
  CHECK(dataset.kind == DatasetKind::kColmap);
  CHECK(dataset.views.size() == 10);
  CHECK(dataset.points.size() == 3);
  CHECK(std::count_if(dataset.views.begin(), dataset.views.end(),
                      [](const View& view) { return !view.mask_path.empty(); }) == 1);
  CHECK(contains(data_error([&] { load_dataset(scratch.path()); }), "/dslr is one"));
}

TEST_CASE("ScanNet++: what its transforms files name lies beside their folder") {
  const Scratch scratch;
  const auto write = [&](const std::string& name, const std::string& keys) {
    write_bytes(scratch / ("dslr/nerfstudio/" + name),
                file_of("\"w\": 20, \"h\": 10, \"fl_x\": 20, \"test_frames\": [" +
                            frame("1.png", 2) + "], ",
                        frame("0.png", 1, keys)));
  };
  write("transforms.json", "");
  write("transforms_undistorted.json", "\"mask_path\": \"0.png\", ");
  for (const char* name : {"0.png", "1.png"}) {
    for (const char* folder : {"resized_images", "resized_undistorted_images"})
      write_image(scratch / "dslr" / folder / name, Image(20, 10, 3, 0.5f));
    write_image(scratch / "dslr/resized_undistorted_masks" / name, Image(20, 10, 1, 1.0f));
  }
  const Dataset dataset = load_dataset(scratch / "dslr/nerfstudio");
  REQUIRE(dataset.views.size() == 2);
  CHECK(dataset.views[1].test);
  CHECK(dataset.views[1].camera.name == "1.png");
  CHECK(contains(dataset.views[0].image_path.string(), "/resized_images/"));
  CHECK(dataset.views[0].mask_path.empty());
  const Dataset undistorted = load_dataset(scratch / "dslr/nerfstudio/transforms_undistorted.json");
  REQUIRE(undistorted.views.size() == 2);
  CHECK(contains(undistorted.views[0].image_path.string(), "/resized_undistorted_images/"));
  CHECK(contains(undistorted.views[0].mask_path.string(), "/resized_undistorted_masks/"));
}

TEST_CASE("photos beside the model, and those in images, go before folders of other names") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "rgb", 40, 30);
  write_photos(fixture, scratch.path(), 40, 30);
  CHECK(load_dataset(scratch.path()).views.front().image_path.parent_path().parent_path() ==
        scratch.path());
  write_photos(fixture, scratch / "images", 40, 30);
  const LogCapture log;
  CHECK(contains(load_dataset(scratch.path()).views.front().image_path.string(), "/images/"));
  CHECK(log.lines() == 0);
}

TEST_CASE("photos of a COLMAP model are found in another letter case, which is told") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_text(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  fs::rename(scratch / "images/left/photo 9.png", scratch / "images/left/Photo 9.PNG");
  fs::rename(scratch / "images/photo 8.png", scratch / "images/PHOTO 8.png");
  {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.size() == 10);
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 10 photos are spelt otherwise"));
  }
  fs::rename(scratch / "images/left", scratch / "images/Left");
  CHECK(load_dataset(scratch.path()).views.size() == 10);
  // Which of two is meant cannot be told.
  fs::copy(scratch / "images/PHOTO 8.png", scratch / "images/pHOTO 8.png");
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).views.size() == 9);
  CHECK(log.contains("'photo 8.png' among them: they are left out"));
}

TEST_CASE("COLMAP photos of another extension are taken where there is one of them, and told") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  for (auto& image : fixture.images) image.name.replace(image.name.size() - 3, 3, "jpg");
  fixture.write_text(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  // Pictures of the same stem are none of the photos, in whatever case their extension is.
  for (const char* other : {"images/photo 8.png", "images/photo 8.exr"})
    write_image(scratch / other, Image(40, 30, 3, 1.0f));
  const auto photo_of = [&](const Dataset& dataset) {
    const auto view =
        std::find_if(dataset.views.begin(), dataset.views.end(),
                     [](const View& each) { return each.camera.name == "photo 8.jpg"; });
    return view == dataset.views.end() ? "" : view->image_path.filename().string();
  };
  fs::rename(scratch / "images/photo 8.jpg", scratch / "images/photo 8.JPG");
  {
    const LogCapture log;
    CHECK(photo_of(load_dataset(scratch.path())) == "photo 8.JPG");
    CHECK(log.lines() == 0);
  }
  fs::rename(scratch / "images/photo 8.JPG", scratch / "images/photo 8.Jpg");
  {
    const LogCapture log;
    CHECK(photo_of(load_dataset(scratch.path())) == "photo 8.Jpg");
    CHECK(log.lines() == 1);
    CHECK(log.contains("1 of 10 photos are spelt otherwise"));
  }
  fs::remove(scratch / "images/photo 8.Jpg");
  {
    const LogCapture log;
    CHECK(photo_of(load_dataset(scratch.path())).empty());
    CHECK(log.contains("'photo 8.jpg' among them: they are left out"));
  }
  fs::remove(scratch / "images/photo 8.exr");
  const LogCapture log;
  CHECK(photo_of(load_dataset(scratch.path())) == "photo 8.png");
  CHECK(log.lines() == 1);
  CHECK(log.contains("1 of 10 photos have another extension than"));
  CHECK(log.contains("('photo 8.jpg')"));
}

TEST_CASE("COLMAP photos developed from raw files are found, which is told") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  write_photos(fixture, scratch / "images", 40, 30);
  for (auto& image : fixture.images) image.name.replace(image.name.size() - 3, 3, "cr2");
  fixture.write_text(scratch / "sparse/0");
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).views.size() == 10);
  CHECK(log.contains("10 of 10 photos have another extension than"));
}

TEST_CASE("reduced copies of other names than the model's are left for images, which is told") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  // As NeRF-LLFF has them.
  for (int i = 0; i < 10; ++i)
    write_image(scratch / "images_4" / ("image00" + std::to_string(i) + ".png"), Image(10, 8, 3));
  DatasetOptions options;
  options.downscale = 4;
  const auto first = [&] { return load_dataset(scratch.path(), options).views.front(); };
  {
    const LogCapture log;
    CHECK(contains(first().image_path.string(), "/images/"));
    CHECK(first().camera.width == 10);
    CHECK(log.contains("images_4 has no photo of the names in the model"));
  }
  write_photos(fixture, scratch / "images_4", 10, 8);
  CHECK(contains(first().image_path.string(), "/images_4/"));
}

TEST_CASE("reduced copies that lack photos of images are left for it, with a warning") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  write_photos(fixture, scratch / "images_2", 20, 15);
  DatasetOptions options;
  options.downscale = 2;
  const auto check = [&](std::size_t views, const std::string& folder, std::size_t lines) {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path(), options);
    CHECK(dataset.views.size() == views);
    CHECK(contains(dataset.views.front().image_path.string(), folder));
    CHECK(dataset.views.front().camera.width == 20);
    CHECK(log.lines() == lines);
    return log.contains("images_2 has 9 of the 10 photos of the model and ");
  };
  CHECK_FALSE(check(10, "/images_2/", 0));
  fs::remove(scratch / "images_2/photo 8.png");
  CHECK(check(10, "/images/", 1));
  // What neither has is left out.
  fs::remove(scratch / "images/photo 8.png");
  CHECK_FALSE(check(9, "/images_2/", 1));
}

TEST_CASE("reduced copies of another size than their folder says are warned of") {
  const ColmapFixture fixture = small_colmap();
  DatasetOptions options;
  options.downscale = 2;
  const auto warns = [&](const Scratch& scratch) {
    const LogCapture log;
    CHECK(load_dataset(scratch.path(), options).views.size() == 10);
    return log.contains("images_2 are 4 times smaller than ") && log.contains(", not 2 times");
  };
  const Scratch scratch;
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images_2", 10, 8);
  CHECK(warns(scratch));  // than the cameras
  write_photos(fixture, scratch / "images", 40, 30);
  CHECK(warns(scratch));
  // Of copies that the model was made of, those in images tell the size.
  write_photos(fixture, scratch / "images", 80, 60);
  write_photos(fixture, scratch / "images_2", 40, 30);
  const LogCapture log;
  CHECK(load_dataset(scratch.path(), options).views.front().camera.width == 40);
  CHECK(log.lines() == 0);
}

TEST_CASE("names of a COLMAP model may begin with a folder of the data set") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  for (std::size_t i = 0; i < fixture.images.size(); ++i)
    fixture.images[i].name =
        (i % 2 == 0 ? "images/cam1/" : "images/cam2/") + std::to_string(i / 2) + ".png";
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch.path(), 40, 30);
  const LogCapture log;
  const Dataset dataset = load_dataset(scratch.path());
  REQUIRE(dataset.views.size() == 10);
  CHECK(log.contains("images has no photo of the names in the model: those in"));
  for (const View& view : dataset.views) CHECK(view.image_path == scratch / view.camera.name);
}

TEST_CASE("parts of a data set are refused with the data set that they are of") {
  const Scratch scratch;
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "scene/sparse/0");
  write_photos(fixture, scratch / "scene/images", 40, 30);
  const std::string scene = (scratch / "scene").lexically_normal().string();
  const auto refusal = [&](const char* part) {
    const std::string message = data_error([&] { load_dataset(scratch / part); });
    CHECK(!contains(message, "raysplats prepare"));
    return message;
  };
  for (const char* part : {"scene/images", "scene/images/", "scene/images/left", "scene/sparse"}) {
    CAPTURE(part);
    CHECK(contains(refusal(part), "it is a part of one: give " + scene));
  }
  CHECK(contains(refusal("scene/sparse/0"), "put them there, or give " + scene + ", which is"));
  // The model of nerfstudio's captures lies a folder deeper.
  fixture.write_binary(scratch / "studio/colmap/sparse/0");
  write_photos(fixture, scratch / "studio/images", 40, 30);
  const std::string studio = (scratch / "studio").lexically_normal().string();
  for (const char* part : {"studio/colmap", "studio/colmap/sparse/0"}) {
    CAPTURE(part);
    CHECK(contains(refusal(part), "or give " + studio + ", which is"));
  }
  // Photos that lie in no data set have no poses yet.
  write_image(scratch / "walk/a.jpg", Image(40, 30, 3));
  CHECK(contains(data_error([&] { load_dataset(scratch / "walk"); }), "raysplats prepare"));
}
