// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/dataset_advice.hpp"

#include <doctest/doctest.h>

#include "unit/temporary_directory.hpp"

using namespace raysplats;

TEST_CASE("a folder looks like a data set by any of the layouts that are read") {
  for (const char* file :
       {"sparse/0/images.bin", "transforms.json", "transforms_train.json", "poses_bounds.npy",
        "colmap/sparse/0/images.bin", "colmap/images.bin", "colmap/images.txt"}) {
    CAPTURE(file);
    const TemporaryDirectory folder;
    folder.write(file, "");
    CHECK(io::looks_like_dataset(folder.path()));
  }
  for (const char* place : {"keyframes/cameras/", "keyframes/corrected_cameras/", "cameras/"}) {
    CAPTURE(place);
    const TemporaryDirectory folder;
    std::string photos = place;
    photos.replace(photos.find("cameras"), 7, "images");
    folder.write(photos + "1.jpg", "");
    CHECK_FALSE(io::looks_like_dataset(folder.path()));
    folder.write(std::string(place) + "1.json", "{}");
    CHECK(io::looks_like_dataset(folder.path()));
  }
}

TEST_CASE("a folder of photos or models alone does not look like a data set") {
  const TemporaryDirectory folder;
  folder.write("images/a.jpg", "");
  folder.write("model.ply", "");
  CHECK_FALSE(io::looks_like_dataset(folder.path()));
  CHECK_FALSE(io::looks_like_dataset(folder / "none"));
}
