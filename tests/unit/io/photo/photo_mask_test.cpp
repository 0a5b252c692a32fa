// SPDX-License-Identifier: Apache-2.0
// Where the masks of photos are found that nothing names.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

using Names = std::vector<std::string>;

void write_model(const Scratch& scratch, const Names& names) {
  ColmapFixture fixture = small_colmap();
  fixture.images.resize(names.size());
  for (std::size_t i = 0; i < names.size(); ++i) fixture.images[i].name = names[i];
  fixture.write_binary(scratch / "sparse/0");
}

/// A file of frames with these photos, which are written; those without an extension as PNG.
void write_frames(const Scratch& scratch, const char* file, const Names& names) {
  std::string frames;
  for (std::size_t i = 0; i < names.size(); ++i) {
    const bool named = names[i].ends_with(".jpg");
    write_image(scratch / (named ? names[i] : names[i] + ".png"), Image(40, 30, 3, 0.5f));
    frames += fmt::format(R"({}{{"file_path": "{}", "transform_matrix": {}}})", i > 0 ? ", " : "",
                          names[i], matrix_json(static_cast<double>(i)));
  }
  write_bytes(scratch / file, fmt::format(R"({{"fl_x": 50, "frames": [{}]}})", frames));
}

void write_mask(const fs::path& path) { write_image(path, Image(40, 30, 1, 1.0f)); }

/// The masks of a data set's photos, in the order of their names.
Names masks_of(const Scratch& scratch) {
  Names out;
  for (const View& view : load_dataset(scratch.path()).views)
    out.push_back(view.mask_path.empty()
                      ? ""
                      : view.mask_path.lexically_relative(scratch.path()).generic_string());
  return out;
}

}  // namespace

TEST_CASE("masks of a COLMAP model lie in their folder alone, whatever the images are called") {
  const Scratch scratch;
  for (const char* name : {"a.png", "b.png"})
    write_image(scratch / "images" / name, Image(40, 30, 3, 0.5f));
  const std::string absolute = (scratch / "images").string() + "/";
  for (const std::string folder :
       {"", "../images/", "C:\\caps\\images\\", "undistorted/", absolute.c_str()}) {
    CAPTURE(folder);
    write_model(scratch, {folder + "a.png", folder + "b.png"});
    fs::remove_all(scratch / "masks");
    write_mask(scratch / "masks/other.png");
    const LogCapture log;
    CHECK(masks_of(scratch) == Names{"", ""});
    CHECK(log.contains("No mask"));
    write_mask(scratch / "masks/b.png");
    CHECK(masks_of(scratch) == Names{"", "masks/b.png"});
  }
}

TEST_CASE("a mask without a folder is that of a photo whose file name no other has") {
  const Scratch scratch;
  const Names names{"left/1.png", "left/2.png", "right/1.jpg"};
  write_model(scratch, names);
  for (const std::string& name : names)
    write_image(scratch / "images" / name, Image(40, 30, 3, 0.5f));
  write_mask(scratch / "masks/1.png");
  write_mask(scratch / "masks/2.png");
  CHECK(masks_of(scratch) == Names{"", "masks/2.png", ""});
  write_mask(scratch / "masks/right/1.png");
  write_mask(scratch / "masks/left/2.png");
  CHECK(masks_of(scratch) == Names{"", "masks/left/2.png", "masks/right/1.png"});
}

TEST_CASE("masks of photos in folders lie as these do, from whatever folder their names begin") {
  const Scratch scratch;
  const Names names{"images/cam1/a.jpg", "images/cam1/b.jpg", "images/cam2/a.jpg"};
  write_frames(scratch, "transforms.json", names);
  write_mask(scratch / "masks/cam1/a.png");
  write_mask(scratch / "masks/cam2/a.png");
  write_mask(scratch / "masks/b.png");
  CHECK(masks_of(scratch) == Names{"masks/cam1/a.png", "masks/b.png", "masks/cam2/a.png"});
  // The longest end of a path goes before shorter ones.
  write_mask(scratch / "masks/images/cam1/a.png");
  write_mask(scratch / "masks/cam1/b_mask.png");
  CHECK(masks_of(scratch) ==
        Names{"masks/images/cam1/a.png", "masks/cam1/b_mask.png", "masks/cam2/a.png"});
  // COLMAP's names begin where another machine had the photos.
  const Scratch moved;
  write_model(moved, {"/caps/images/cam1/a.jpg", "/caps/images/cam1/b.jpg"});
  for (const char* name : {"images/a.jpg", "images/b.jpg"})
    write_image(moved / name, Image(40, 30, 3, 0.5f));
  write_mask(moved / "masks/cam1/a.png");
  write_mask(moved / "masks/images/cam1/b.png");
  CHECK(masks_of(moved) == Names{"masks/cam1/a.png", "masks/images/cam1/b.png"});
}

TEST_CASE("a mask that may be of several photos is of none, unless it lies as one of them") {
  const Scratch scratch;
  write_frames(scratch, "transforms.json", {"images/1.jpg", "images/left/1.jpg"});
  write_mask(scratch / "masks/1.png");
  CHECK(masks_of(scratch) == Names{"masks/1.png", ""});
  write_mask(scratch / "masks/left/1.png");
  CHECK(masks_of(scratch) == Names{"masks/1.png", "masks/left/1.png"});

  // The photos of a data set count together, whatever file names them.
  const Scratch blender;
  write_frames(blender, "transforms_train.json", {"train/r_0", "train/r_1"});
  write_frames(blender, "transforms_test.json", {"test/r_0"});
  write_mask(blender / "masks/r_0.png");
  write_mask(blender / "masks/r_1.png");
  CHECK(masks_of(blender) == Names{"", "masks/r_1.png", ""});
  write_mask(blender / "masks/test/r_0.png");
  CHECK(masks_of(blender) == Names{"", "masks/r_1.png", "masks/test/r_0.png"});
  // Nor does what follows a point in a name without an extension make two names one.
  const Scratch pointed;
  write_frames(pointed, "transforms.json", {"l/f.1", "r/f.1", "r/f.2"});
  write_mask(pointed / "masks/f.1.png");
  write_mask(pointed / "masks/f.2.png");
  CHECK(masks_of(pointed) == Names{"", "", "masks/f.2.png"});
}

TEST_CASE("masks lie in a folder mask too, in any letter case") {
  for (const char* folder : {"masks", "mask", "Masks", "MASK"}) {
    CAPTURE(folder);
    const Scratch scratch;
    write_frames(scratch, "transforms.json", {"image/000.jpg", "image/001.jpg"});
    write_mask(scratch / folder / "001.png");
    const LogCapture log;
    CHECK(masks_of(scratch) == Names{"", std::string(folder) + "/001.png"});
    CHECK(log.contains("1 of 2 photos have no mask"));
    CHECK(log.contains("000.jpg among them"));
  }
}

TEST_CASE("a photo that is spelt otherwise than in its file has the mask of its own spelling") {
  const Scratch scratch;
  write_frames(scratch, "transforms.json", {"images/a.jpg", "images/l/b.jpg", "images/r/b.jpg"});
  fs::rename(scratch / "images", scratch / "Images");
  fs::rename(scratch / "Images/a.jpg", scratch / "Images/A.JPG");
  for (const char* folder : {"l", "r"})
    fs::rename(scratch / "Images" / folder / "b.jpg", scratch / "Images" / folder / "B.jpg");
  write_mask(scratch / "masks/A.png");
  write_mask(scratch / "masks/B.png");
  // As ever the mask of two photos is that of none.
  CHECK(masks_of(scratch) == Names{"masks/A.png", "", ""});
  write_mask(scratch / "masks/l/B.png");
  write_mask(scratch / "masks/Images/r/B.jpg.png");
  CHECK(masks_of(scratch) == Names{"masks/A.png", "masks/l/B.png", "masks/Images/r/B.jpg.png"});

  const Scratch colmap;
  write_model(colmap, {"a.JPG", "b.JPG"});
  for (const char* name : {"a.jpg", "b.jpg"})
    write_image(colmap / "images" / name, Image(40, 30, 3, 0.5f));
  write_mask(colmap / "masks/b.jpg.png");
  CHECK(masks_of(colmap) == Names{"", "masks/b.jpg.png"});
}

TEST_CASE("masks beside photos: those of 3dgrut are read, those of instant-ngp told") {
  const Scratch scratch;
  write_frames(scratch, "transforms.json", {"images/a.jpg", "images/b"});
  write_mask(scratch / "images/a_mask.png");
  write_mask(scratch / "images/b_mask.png");
  CHECK(masks_of(scratch) == Names{"images/a_mask.png", "images/b_mask.png"});
  write_mask(scratch / "masks/b.png");
  CHECK(masks_of(scratch) == Names{"images/a_mask.png", "masks/b.png"});
  // A photo is no mask.
  const Scratch photos;
  write_frames(photos, "transforms.json", {"images/a", "images/a_mask"});
  CHECK(masks_of(photos) == Names{"", ""});

  const Scratch dynamic;
  write_frames(dynamic, "transforms.json", {"images/a", "images/b"});
  write_mask(dynamic / "images/dynamic_mask_b.png");
  const LogCapture log;
  CHECK(masks_of(dynamic) == Names{"", ""});
  CHECK(log.contains("1 of 2 photos have a mask of instant-ngp"));
  CHECK(log.contains("dynamic_mask_b.png"));
}
