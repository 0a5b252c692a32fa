// SPDX-License-Identifier: Apache-2.0
// The lists of a nerfstudio file, which say what is trained on and what is held out.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <string>

#include "raysplats/dataset.hpp"
#include "unit/io/transforms_fixture.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// A list of the frames whose numbers these are.
std::string list_of(const char* key, const std::string& numbers) {
  std::string names;
  for (const char number : numbers)
    names += fmt::format("{}\"images/f{}.png\"", names.empty() ? "" : ", ", number);
  return fmt::format("\"{}\": [{}], ", key, names);
}

/// Eight frames and these lists.
Dataset dataset_of(const Scratch& scratch,
                   const std::string& train,
                   const std::string& validation,
                   const std::string& test) {
  std::string frames;
  for (int i = 0; i < 8; ++i) {
    const std::string name = fmt::format("images/f{}.png", i);
    write_image(scratch / name, Image(10, 10, 3));
    frames += fmt::format(R"({}{{"file_path": "{}", "transform_matrix": {}}})", i > 0 ? ", " : "",
                          name, matrix_json(i));
  }
  write_bytes(scratch / "transforms.json",
              "{\"w\": 10, \"h\": 10, \"fl_x\": 20, " + list_of("train_filenames", train) +
                  list_of("val_filenames", validation) + list_of("test_filenames", test) +
                  "\"frames\": [" + frames + "]}");
  return load_dataset(scratch.path());
}

}  // namespace

TEST_CASE("frames that are for validation only are said to be so") {
  const Scratch scratch;
  const LogCapture log;
  CHECK(dataset_of(scratch, "01234", "5", "6").views.size() == 6);
  CHECK(log.contains("1 of 8 frames"));
  CHECK(log.contains("for validation only"));
  CHECK(log.contains("are in none of its lists"));
  CHECK(log.lines() == 2);
}

TEST_CASE("frames to train on that are in the list to test too are held out, which is told") {
  const Scratch scratch;
  const LogCapture log;
  const Dataset dataset = dataset_of(scratch, "0123456", "7", "67");
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{6, 7});
  CHECK(log.contains("1 of 7 names"));
  CHECK(log.contains("'images/f6.png' among them"));
}

TEST_CASE("lists that all name every frame count as none") {
  const Scratch scratch;
  const LogCapture log;
  const Dataset dataset = dataset_of(scratch, "01234567", "01234567", "01234567");
  CHECK(dataset.views.size() == 8);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{0});
  CHECK(log.contains("they are not used"));
  CHECK(log.lines() == 1);
}

TEST_CASE(
    "frames to test in a list of their own are held out, unless lists of names say otherwise") {
  const Scratch scratch;
  std::string train, test;
  for (int i = 0; i < 6; ++i) {
    const std::string name = fmt::format("f{}.png", i);
    write_image(scratch / name, Image(10, 10, 3));
    std::string& frames = i < 4 ? train : test;
    if (!frames.empty()) frames += ",";
    frames += frame(name, i);
  }
  const auto loaded = [&](const std::string& keys) {
    write_bytes(scratch / "transforms.json",
                file_of("\"w\": 10, \"h\": 10, \"fl_x\": 20, " + keys, train));
    return load_dataset(scratch.path());
  };
  const Dataset dataset = loaded("\"test_frames\": [" + test + "], ");
  REQUIRE(dataset.views.size() == 6);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{4, 5});
  CHECK(loaded("\"test_frames\": [], ").views.size() == 4);
  const Dataset named = loaded(
      "\"train_filenames\": [\"f1.png\", \"f4.png\"], \"test_filenames\": [\"f0.png\"], "
      "\"test_frames\": [" +
      test + "], ");
  REQUIRE(named.views.size() == 3);
  CHECK(named.indices(Split::kTest) == std::vector<std::size_t>{0});
  const auto marked = [](const std::string& frames, const char* value) {
    return "{\"is_bad\": " + std::string(value) + ", " + frames.substr(1);
  };
  {
    const LogCapture log;
    const std::string all = train;
    train = marked(all, "true");
    const Dataset rest = loaded("\"test_frames\": [" + marked(test, "false") + "], ");
    REQUIRE(rest.views.size() == 5);
    CHECK(rest.views[0].camera.name == "f1.png");
    CHECK(rest.indices(Split::kTest) == std::vector<std::size_t>{3, 4});
    CHECK(log.contains("1 of 6 frames of"));
    train = marked(frame("f0.png", 0), "1");
    CHECK(contains(data_error([&] { loaded(""); }), "every frame is marked as 'is_bad'"));
    train = all;
  }
  CHECK(contains(data_error([&] { loaded("\"test_frames\": 3, "); }), "'test_frames' is no list"));
  CHECK(contains(data_error([&] { loaded("\"test_frames\": [{\"file_path\": \"f4.png\"}], "); }),
                 "test frame 0: the transform_matrix is missing"));
}
