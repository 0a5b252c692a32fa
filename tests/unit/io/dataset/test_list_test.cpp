// SPDX-License-Identifier: Apache-2.0
// Lists of held-out photos: those that users give, and those that come with COLMAP models.
#include "io/dataset/test_list.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>

#include <set>
#include <string>
#include <vector>

#include "io/dataset/data_option_table.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

using Names = std::set<std::string>;

Names held_out(const Dataset& dataset) {
  Names names;
  for (const std::size_t i : dataset.indices(Split::kTest))
    names.insert(dataset.views[i].camera.name);
  return names;
}

Dataset load_with(const Scratch& scratch, const Names& list) {
  DatasetOptions options;
  options.test_list = list;
  return load_dataset(scratch.path(), options);
}

std::string refusal(const Scratch& scratch, const Names& list) {
  return message_of<UsageError>([&] { load_with(scratch, list); });
}

/// "left/photo 9.png", "photo 8.png", "left/photo 7.png" and so on, and their model.
struct Colmap {
  Scratch scratch;
  Colmap() {
    const ColmapFixture fixture = small_colmap();
    fixture.write_binary(scratch / "sparse/0");
    write_photos(fixture, scratch / "images", 40, 30);
  }
};

void write_frames(const Scratch& scratch, const char* file, const std::vector<std::string>& names) {
  std::string frames;
  for (std::size_t i = 0; i < names.size(); ++i) {
    write_image(scratch / (names[i] + ".png"), Image(10, 10, 3));
    frames += fmt::format(R"({}{{"file_path": "{}", "transform_matrix": {}}})", i > 0 ? ", " : "",
                          names[i], matrix_json(static_cast<double>(i)));
  }
  write_bytes(scratch / file, "{\"camera_angle_x\": 0.8, \"frames\": [" + frames + "]}");
}

}  // namespace

TEST_CASE("a list holds out the photos that it names, in the spellings that people use") {
  const Colmap colmap;
  const Names photos{"left/photo 7.png", "photo 8.png"};
  for (const Names& list :
       {photos, Names{"photo 7.png", "photo 8"}, Names{"./left/photo 7", "images/photo 8.png"},
        Names{"/moved/images/left/photo 7.png", "images_4/photo 8.png"},
        Names{"left\\photo 7.png", "photo 8.png", "images/photo 8.png"}}) {
    const Dataset dataset = load_with(colmap.scratch, list);
    CHECK(held_out(dataset) == photos);
    CHECK(dataset.views.size() == 10);
    CHECK(dataset.test_every == 0);
    CHECK(dataset.read_as->test_list == list);
  }
  CHECK(held_out(load_with(colmap.scratch, {})).empty());
}

TEST_CASE("names in a list that mean no photo, or several, are counted and refused") {
  const Colmap colmap;
  fs::rename(colmap.scratch / "images/photo 8.png", colmap.scratch / "images/photo 8.jpg");
  CHECK(held_out(load_with(colmap.scratch, {"photo 8.jpg"})) == Names{"photo 8.png"});
  CHECK(contains(refusal(colmap.scratch, {"photo 6.png", "photo 77.png", "right/photo 9.png"}),
                 "2 of 3 names in the list of test photos mean no photo of " +
                     colmap.scratch.path().string() + ", or several, 'photo 77.png' the first"));
  CHECK(contains(refusal(colmap.scratch, {"oto 6.png"}), "1 of 1"));
  CHECK(contains(refusal(colmap.scratch, {"/"}), "1 of 1"));

  const Scratch blender;
  write_frames(blender, "transforms_train.json", {"train/r_0", "train/r_1"});
  write_frames(blender, "transforms_test.json", {"test/r_0", "test/r_2"});
  CHECK(contains(refusal(blender, {"r_0.png"}), "or several, 'r_0.png' the first"));
}

TEST_CASE("of photos that a path ends in, the one with the longest name is meant") {
  const Scratch scratch;
  write_frames(scratch, "transforms_train.json", {"a 1", "left/a 1", "left/b", "b"});
  const auto listed = [&](const char* name) { return held_out(load_with(scratch, {name})); };
  for (const char* name : {"left/a 1", "images/left/a 1.png", "/moved/left/a 1", "./left/a 1.png"})
    CHECK(listed(name) == Names{"left/a 1.png"});
  for (const char* name : {"a 1.png", "a 1", "images/a 1.png", "/moved/right/a 1"})
    CHECK(listed(name) == Names{"a 1.png"});
}

TEST_CASE("what files hold out and a list does not name is left out") {
  const Scratch scratch;
  write_frames(scratch, "transforms_train.json", {"train/r_0", "train/r_1", "train/r_2"});
  write_frames(scratch, "transforms_test.json", {"test/r_0", "test/r_5", "test/r_7"});
  const LogCapture log;
  const Dataset dataset = load_with(scratch, {"test/r_5", "r_1.png"});
  CHECK(held_out(dataset) == Names{"test/r_5.png", "train/r_1.png"});
  CHECK(dataset.views.size() == 4);
  CHECK(log.contains("2 of 6 photos are left out"));
}

TEST_CASE("a list goes before those of a nerfstudio file, and frees photos that are in none") {
  const Scratch scratch;
  std::string frames;
  for (int i = 0; i < 6; ++i) {
    write_image(scratch / fmt::format("f{}.png", i), Image(10, 10, 3));
    frames += fmt::format(R"({}{{"file_path": "f{}.png", "transform_matrix": {}}})",
                          i > 0 ? ", " : "", i, matrix_json(i));
  }
  write_bytes(scratch / "transforms.json",
              "{\"w\": 10, \"h\": 10, \"fl_x\": 20, \"train_filenames\": [\"f0.png\", \"f1.png\", "
              "\"f2.png\"], \"val_filenames\": [\"f3.png\"], \"test_filenames\": [\"f4.png\"], "
              "\"frames\": [" +
                  frames + "]}");
  CHECK(held_out(load_dataset(scratch.path())) == Names{"f4.png"});
  const Dataset dataset = load_with(scratch, {"f0", "f3"});
  CHECK(held_out(dataset) == Names{"f0.png", "f3.png"});
  CHECK(dataset.views.size() == 4);
}

TEST_CASE("test.txt beside a COLMAP model says what is held out, as 3DGS reads it") {
  const Colmap colmap;
  write_bytes(colmap.scratch / "sparse/0/test.txt", "left/photo 1.png\r\nphoto 2.png\r\n\r\n");
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(colmap.scratch.path());
    CHECK(held_out(dataset) == Names{"left/photo 1.png", "photo 2.png"});
    CHECK(dataset.views.size() == 10);
    CHECK(dataset.test_every == 0);
    CHECK(log.contains("sparse/0/test.txt"));
    CHECK(log.lines() == 1);
  }
  CHECK(load_with(colmap.scratch, {"photo 4"}).views.size() == 8);
  write_bytes(colmap.scratch / "sparse/0/test.txt", "left/photo 1.png\nphoto 22.png\n");
  {
    const LogCapture log;
    CHECK(held_out(load_dataset(colmap.scratch.path())) == Names{"left/photo 1.png"});
    CHECK(log.contains("1 of 2 names"));
    CHECK(log.contains("'photo 22.png'"));
  }
  write_bytes(colmap.scratch / "sparse/0/test.txt", "iteration 7\n");
  const LogCapture log;
  CHECK(load_dataset(colmap.scratch.path()).test_every == 8);
  CHECK(log.contains("names no photo of the COLMAP model"));
}

TEST_CASE("a list that leaves no photo of a COLMAP model to train on is not used") {
  const Colmap colmap;
  std::string all;
  for (const View& view : load_dataset(colmap.scratch.path()).views) all += view.camera.name + "\n";
  const LogCapture log;
  const auto count = [&] {
    const Dataset dataset = load_dataset(colmap.scratch.path());
    CHECK(dataset.test_every == 8);
    return dataset.indices(Split::kTrain).size();
  };
  write_bytes(colmap.scratch / "sparse/0/test.txt", all);
  CHECK(count() == 8);
  CHECK(log.contains("sparse/0/test.txt holds out every photo of the COLMAP model"));
  CHECK(load_with(colmap.scratch, {"photo 4.png"}).views.size() == 10);
  fs::remove(colmap.scratch / "sparse/0/test.txt");
  write_bytes(colmap.scratch / "train_list.txt", "photo 4.png\n");
  write_bytes(colmap.scratch / "test_list.txt", "photo 4.png\nphoto 2.png\n");
  CHECK(count() == 8);
  CHECK(log.contains("test_list.txt leaves no photo to train on of the COLMAP model"));
}

TEST_CASE("a file that lists no photo of a COLMAP model leaves it to the next") {
  const Colmap colmap;
  const Names photos{"photo 2.png"};
  write_bytes(colmap.scratch / "train_test_lists.json",
              R"({"train": ["photo 4.png"], "test": ["photo 2.png"]})");
  for (const std::string& text :
       {std::string(), std::string("# notes\nto do\n"), std::string("\xff\xfe\0p\0h\0\n", 8)}) {
    write_bytes(colmap.scratch / "sparse/0/test.txt", text);
    write_bytes(colmap.scratch / "test_list.txt", text);
    const LogCapture log;
    CHECK(held_out(load_dataset(colmap.scratch.path())) == photos);
    CHECK(log.contains("sparse/0/test.txt names no photo of the COLMAP model"));
    CHECK(log.contains("/test_list.txt names no photo of the COLMAP model"));
    CHECK(log.contains("held out are those of " +
                       (colmap.scratch / "train_test_lists.json").string()));
  }
  write_bytes(colmap.scratch / "test_list.txt", "photo 6.png\n");
  CHECK(held_out(load_dataset(colmap.scratch.path())) == Names{"photo 6.png"});
}

TEST_CASE("photos that lists would train on and test are said to be what becomes of them") {
  const Colmap colmap;
  write_bytes(colmap.scratch / "train_list.txt", "photo 4.png\nphoto 2.png\n");
  write_bytes(colmap.scratch / "test_list.txt", "photo 2.png\n");
  const LogCapture log;
  (void)load_with(colmap.scratch, {"photo 4.png"});
  CHECK(log.contains("among them: what of these --test-list does not name is left out"));
  CHECK_FALSE(log.contains("these are held out"));
  (void)load_dataset(colmap.scratch.path());
  CHECK(log.contains("these are held out"));
}

TEST_CASE("lists of nerfstudio and ScanNet++ beside a COLMAP model divide its photos") {
  const Colmap colmap;
  write_bytes(colmap.scratch / "train_test_lists.json",
              R"({"train": ["left/photo 9.png", "photo 8.png", "left/photo 7.png"],)"
              R"( "test": ["photo 0.png"], "has_masks": false})");
  Dataset dataset = load_dataset(colmap.scratch.path());
  CHECK(held_out(dataset) == Names{"photo 0.png"});
  CHECK(dataset.views.size() == 4);

  write_bytes(colmap.scratch / "test_list.txt", "photo 2.png\nleft/photo 3.png\n");
  dataset = load_dataset(colmap.scratch.path());
  CHECK(held_out(dataset) == Names{"left/photo 3.png", "photo 2.png"});
  CHECK(dataset.views.size() == 10);
  write_bytes(colmap.scratch / "train_list.txt", "photo 4.png\nleft/photo 5.png\n");
  dataset = load_dataset(colmap.scratch.path());
  CHECK(held_out(dataset) == Names{"left/photo 3.png", "photo 2.png"});
  CHECK(dataset.views.size() == 4);
  CHECK(held_out(load_with(colmap.scratch, {"photo 8.png"})) == Names{"photo 8.png"});
  write_bytes(colmap.scratch / "train_test_lists.json", "{");
  CHECK(load_dataset(colmap.scratch.path()).views.size() == 4);
  for (const char* name : {"test_list.txt", "train_list.txt"}) fs::remove(colmap.scratch / name);
  CHECK(contains(data_error([&] { load_dataset(colmap.scratch.path()); }), "train_test_lists"));
}

TEST_CASE("the option of a list reads a file, and holds its names from then on") {
  const Scratch scratch;
  write_bytes(scratch / "list.txt", "\xef\xbb\xbf# published\n\n  b.png \r\nleft\\a 1.png\n");
  const std::string path = (scratch / "list.txt").string();
  const Names names{"b.png", "left/a 1.png"};
  CHECK(read_test_list(path) == names);
  DatasetOptions options;
  const std::vector<OptionRow> rows = data_option_rows(options);
  const OptionRow& row = *find_row(rows, "test-list");
  CHECK(row.text() == "\"\"");
  row.set({path});
  fs::remove(path);
  CHECK(options.test_list == names);
  CHECK(row.text() == "'''\nb.png\nleft/a 1.png\n'''");
  CHECK(brief_value(row.text()) == "a list of 2");
  check_values(rows);
  CHECK(options.test_list == names);
  for (const Names& some : {Names{}, Names{"one.png"}, Names{"#1.png", "it's.png", "2.png"}}) {
    options.test_list = some;
    check_values(rows);
    CHECK(options.test_list == some);
    CHECK(brief_value(row.text()) == fmt::format("a list of {}", some.size()));
  }
  row.set({""});
  CHECK_FALSE(options.test_list.has_value());
  CHECK(contains(data_error([&] { row.set({path}); }), "list.txt"));
  for (const char* bad : {"\xff\xfe\n", "a'''b\n", "\x01\n"})
    CHECK(contains(message_of<UsageError>([&] { row.set({bad}); }), "text file of UTF-8"));
  const auto refused = [&](const std::string& text) {
    write_bytes(path, text);
    return message_of<UsageError>([&] { row.set({path}); });
  };
  CHECK(contains(refused("\xff\xfe"
                         "a"),
                 path + " is not of UTF-8"));
  CHECK(contains(refused(std::string("a\0b\0", 4)), path + " has control characters"));
  CHECK(contains(refused("a'''b"), path + " has ''' in a name"));
  CHECK(contains(refused(std::string(300'000, 'a')), path + " has 300001 bytes of names, more"));
}

TEST_CASE(
    "a number goes before the list of a run, a list before its number, and both are refused") {
  DatasetOptions run;
  run.test_list = Names{"a.png"};
  DataSettings number, list, both;
  number.set("test-every", {"4"});
  CHECK_FALSE(number.over(run).test_list.has_value());
  CHECK(DataSettings().over(run).test_list == run.test_list);
  list.set("test-list", {"b.png\n"});
  CHECK(list.over(run).test_list == Names{"b.png"});
  both.set("test-list", {"b.png\n"});
  both.set("test-every", {"4"});
  CHECK(contains(message_of<UsageError>([&] { (void)both.over(run); }), "contradict each other"));
}
