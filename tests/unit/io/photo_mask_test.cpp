// SPDX-License-Identifier: Apache-2.0
// Where the masks of photos are found that nothing names.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "data_sets.hpp"
#include "raysplats/dataset.hpp"
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
