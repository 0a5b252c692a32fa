// SPDX-License-Identifier: Apache-2.0
// Photos and folders whose names are spelt otherwise.
#include "io/dataset/find_image.hpp"

#include <doctest/doctest.h>

#include <optional>
#include <string>
#include <vector>

#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// U+00E4 and an a with U+0308 behind it, and likewise in capitals.
const std::string kComposed = "B\xC3\xA4r", kDecomposed = "Ba\xCC\x88r";
const std::string kComposedCapital = "B\xC3\x84r", kDecomposedCapital = "BA\xCC\x88r";

/// What is found in a folder that has these files, relative to it; "" for nothing.
std::string found_among(const std::vector<std::string>& files, const std::string& name) {
  const Scratch scratch;
  for (const std::string& file : files) scratch.write(file, "");
  io::RespeltFinder finder;
  const std::optional<fs::path> found = finder.find(scratch.path(), name);
  return found ? found->lexically_relative(scratch.path()).generic_string() : "";
}

}  // namespace

TEST_CASE("images are found in another letter case, in name, extension and folders") {
  CHECK(found_among({"Img_1.Jpg", "img_2.jpg"}, "IMG_1.JPG") == "Img_1.Jpg");
  CHECK(found_among({"Img_1.Jpg", "img_2.jpg"}, "IMG_3.JPG").empty());
  CHECK(found_among({"Photos/Left/a.png", "other/a.png"}, "photos/LEFT/A.png") ==
        "Photos/Left/a.png");
  CHECK(found_among({"photos/a.png"}, "./photos/../Photos/A.png") == "photos/a.png");
  // The extension is a part of the name where there is one.
  CHECK(found_among({"a.png"}, "A.jpg").empty());
  CHECK(found_among({"a.png", "a.jpg"}, "A.jpg") == "a.jpg");
  CHECK(found_among({"scan.01.PNG", "scan.02.PNG"}, "Scan.01") == "scan.01.PNG");
}

TEST_CASE("images are found where the marks of letters are characters of their own") {
  CHECK(found_among({kDecomposed + ".png"}, kComposed + ".png") == kDecomposed + ".png");
  CHECK(found_among({kComposed + ".png"}, kDecomposed + ".png") == kComposed + ".png");
  CHECK(found_among({kComposed + "/1.png"}, kDecomposed + "/1.png") == kComposed + "/1.png");
  CHECK(found_among({kComposed + ".PNG"}, "b" + kDecomposed.substr(1)) == kComposed + ".PNG");
  CHECK(found_among({kDecomposedCapital + ".png"}, kDecomposed + ".png") ==
        kDecomposedCapital + ".png");
  CHECK(found_among({kComposedCapital + ".png"}, kDecomposed + ".png") ==
        kComposedCapital + ".png");
  // Capitals beyond ASCII are other letters unless they are written in two ways.
  CHECK(found_among({kComposedCapital + ".png"}, kComposed + ".png").empty());
  // A letter without its mark is another one.
  CHECK(found_among({kComposed + ".png"}, "Bar.png").empty());
  CHECK(found_among({"Bar.png", kDecomposed + ".png"}, kComposed + ".png") == kDecomposed + ".png");
}

TEST_CASE("a path through a link leads where the system follows it, with or without extension") {
  const Scratch scratch;
  for (const char* file : {"real/images/0.png", "real/images/1.JPG", "other/images/0.png",
                           "other/images/1.jpg", "other/images/2.png", "real/scene/own.png"})
    scratch.write(file, "");
  fs::create_directory_symlink("../real/scene", scratch / "other/scene");
  const auto found = [&](const char* path) {
    const auto image = io::find_image(scratch / "other/scene", path);
    return image ? fs::canonical(*image).lexically_relative(fs::canonical(scratch.path())).string()
                 : "";
  };
  CHECK(found("../images/0.png") == "real/images/0.png");
  CHECK(found("../images/0") == "real/images/0.png");
  CHECK(found("../images/1") == "real/images/1.JPG");
  CHECK(found("../images/1.jpg") == "real/images/1.JPG");
  CHECK(found("../../real/images/0.png") == "real/images/0.png");
  // What the system does not find is sought where the names alone lead.
  CHECK(found("missing/../own.png") == "real/scene/own.png");
  CHECK(found("../images/2.png").empty());
  // One file has one spelling.
  CHECK(io::find_image(scratch / "other/scene", ".././images/0.png") ==
        io::find_image(scratch / "other/scene", "../images/0.png"));
  CHECK(io::find_image(scratch / "real/scene", "../images/0.png") == scratch / "real/images/0.png");
}

TEST_CASE("of several images that differ in spelling alone none is found") {
  CHECK(found_among({"a.Jpg", "A.jpg"}, "a.jpg").empty());
  CHECK(found_among({"a.png", "A.jpg"}, "A").empty());
  CHECK(
      found_among({kDecomposed + ".png", kDecomposedCapital + ".png"}, kComposed + ".png").empty());
  CHECK(found_among({"Left/a.png", "LEFT/a.png"}, "left/a.png").empty());
  // What is no image or no folder is no candidate.
  CHECK(found_among({"a.txt", "A.jpg"}, "a") == "A.jpg");
  CHECK(found_among({"a.JPG/x.png", "A.jpg"}, "a.jpg") == "A.jpg");
  CHECK(found_among({"LEFT", "Left/a.png"}, "left/a.png") == "Left/a.png");
}

TEST_CASE("no image is found by absolute paths and in folders that are not there") {
  const Scratch scratch;
  scratch.write("a.png", "");
  io::RespeltFinder finder;
  CHECK_FALSE(finder.find(scratch.path(), scratch / "A.png"));
  CHECK_FALSE(finder.find(scratch / "images", "A.png"));
  CHECK_FALSE(finder.find(scratch.path(), "images/A.png"));
}

TEST_CASE("folders are found as they are named, else by the single other spelling") {
  const Scratch scratch;
  for (const char* name : {"masks/1", "Masks/1", "RGB/1", "Color/1", "COLOR/1"})
    scratch.write(name, "");
  scratch.write("Depth", "");
  io::RespeltFinder finder;
  CHECK(finder.find_folder(scratch.path(), "masks") == scratch / "masks");
  CHECK(finder.find_folder(scratch.path(), "rgb") == scratch / "RGB");
  CHECK_FALSE(finder.find_folder(scratch.path(), "color"));
  CHECK_FALSE(finder.find_folder(scratch.path(), "depth"));
}

TEST_CASE("a folder is listed once for all names that are sought in it") {
  const Scratch scratch;
  scratch.write("Images/A.png", "");
  io::RespeltFinder finder;
  CHECK(finder.find(scratch.path(), "images/a.png") == scratch / "Images/A.png");
  // Read again, the folders would have two candidates each.
  scratch.write("Images/a.PNG", "");
  scratch.write("IMAGES/A.png", "");
  CHECK(finder.find(scratch.path(), "images/a.png") == scratch / "Images/A.png");
  CHECK_FALSE(io::RespeltFinder().find(scratch.path(), "images/a.png"));
  CHECK_FALSE(io::RespeltFinder().find(scratch / "Images", "a.png"));
}
