// SPDX-License-Identifier: Apache-2.0
// COLMAP models of which a part that nobody needs is damaged or unknown.
#include <doctest/doctest.h>

#include "io/dataset/colmap_model.hpp"
#include "raysplats/dataset.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("cameras of a COLMAP model that no image names may have any lens") {
  const Scratch scratch;
  ColmapFixture fixture = small_colmap();
  fixture.cameras.push_back({2, 1, "PINHOLE", 40, 30, {-1, 51, 20, 15}});
  fixture.cameras.push_back({3, 1, "PINHOLE", 0, 30, {50, 51, 20, 15}});
  fixture.write_binary(scratch / "binary");
  CHECK(io::read_colmap_model(scratch / "binary").cameras.size() == 3);
  // A line ends what is not known; the numbers of a binary file would have no end.
  fixture.cameras.back().model_name = "MEI";
  fixture.write_text(scratch / "text");
  CHECK(io::read_colmap_model(scratch / "text").cameras.size() == 3);
  fixture.images.front().camera = 3;
  fixture.write_text(scratch / "text");
  CHECK(contains(data_error([&] { io::read_colmap_model(scratch / "text"); }), "'MEI'"));
  fixture.images.front().camera = 2;
  fixture.write_binary(scratch / "binary");
  CHECK(contains(data_error([&] { io::read_colmap_model(scratch / "binary"); }), "not positive"));
}

TEST_CASE("of several COLMAP models those that are damaged are left out and told") {
  const Scratch scratch;
  const ColmapFixture all = small_colmap();
  ColmapFixture part = all;
  part.images.resize(4);
  part.write_binary(scratch / "sparse/0");
  write_photos(all, scratch / "images", 40, 30);
  const auto views = [&] { return load_dataset(scratch.path()).views.size(); };
  write_bytes(scratch / "sparse/1/cameras.bin", "");
  write_bytes(scratch / "sparse/1/images.bin", "");
  {
    const LogCapture log;
    CHECK(views() == 4);
    CHECK(log.contains("cannot be read and is not used: "));
    CHECK(log.contains("sparse/1/images.bin"));
  }
  // More images, but of no cameras.
  all.write_binary(scratch / "sparse/1");
  CHECK(views() == 10);
  write_bytes(scratch / "sparse/1/cameras.bin", all.cameras_binary().substr(0, 50));
  {
    const LogCapture log;
    CHECK(views() == 4);
    CHECK(log.contains("sparse/1/cameras.bin"));
  }
  write_bytes(scratch / "sparse/0/images.bin", "");
  CHECK(contains(data_error([&] { views(); }), "sparse/0/images.bin"));
}
