// SPDX-License-Identifier: Apache-2.0
// Where the photos of a COLMAP model are found.
#include "io/photo_folder.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <string>

#include "data_sets.hpp"
#include "raysplats/dataset.hpp"
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
