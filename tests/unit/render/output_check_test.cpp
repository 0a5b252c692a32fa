// SPDX-License-Identifier: Apache-2.0
#include "render/output_check.hpp"

#include <doctest/doctest.h>

#include <string>

#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

TEST_CASE("the folders of a data set that has not been named are found all the same") {
  const TemporaryDirectory folder;
  folder.write("cap/transforms_train.json",
               R"({"frames":[{"file_path":"./rgb/0001","depth_file_path":"far/0001.png"}, 7]})");
  folder.write("cap/transforms_test.json", "{ cut");
  for (const char* photo : {"cap/rgb/0001.png", "cap/far/0001.png", "cap/test/0001.png"})
    folder.write(photo, "");
  folder.write("cc/sparse/0/images.bin", "");
  folder.write("cc/images/left/a.png", "");
  fs::create_directory_symlink(folder / "cc/images", folder / "link");
  for (const char* place : {"cap", "cap/", "cap/rgb", "cap/rgb/", "cap/far", "cap/test", "cc",
                            "cc/images", "cc/images/left", "link"}) {
    CAPTURE(place);
    CHECK(data_set_of(folder / place).has_value());
    std::string message;
    try {
      check_outside_data(folder / place);
    } catch (const UsageError& error) {
      message = error.what();
    }
    CHECK(message.find("--overwrite") != std::string::npos);
    CHECK(message.find('\n') == std::string::npos);
  }
}

TEST_CASE("new folders, pictures of one's own and runs in a data set are no part of it") {
  const TemporaryDirectory folder;
  folder.write("cap/transforms.json", R"({"frames":[{"file_path":"images/a.png"}]})");
  folder.write("cap/images/a.png", "");
  folder.write("cap/frames/a.png", "");
  for (const char* run : {"cap/run", "cap/train"}) {
    folder.write(std::string(run) + "/config.toml", "");
    folder.write(std::string(run) + "/cameras.json", "[]");
    fs::create_directories(folder / run / "eval");
  }
  for (const char* place : {"cap/frames", "cap/new", "cap/run", "cap/run/eval", "cap/train",
                            "cap/train/eval", "elsewhere"}) {
    CAPTURE(place);
    CHECK_FALSE(data_set_of(folder / place).has_value());
    CHECK_NOTHROW(check_outside_data(folder / place));
  }
}
