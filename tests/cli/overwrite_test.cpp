// SPDX-License-Identifier: Apache-2.0
// A file that is there stays, whichever command is told to write it, unless --overwrite is given.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "program.hpp"

namespace fs = std::filesystem;

namespace {

/// What the commands read, and how each is told to write a file.
class Place {
 public:
  struct Writer {
    Words command;       ///< without the file and --overwrite
    std::string option;  ///< that names the file
    std::string ending;
  };

  Place() {
    write_file(path("m.ply"), ply_file(3));
    write_npy(path("rays.npy"), "False", "(1, 6)", {0, 0, -6, 0, 0, 1});
    for (const char* run : {"a", "b"}) write_file(path(run + std::string("/metrics.json")), "{}");
    writers = {{{"convert", path("m.ply")}, "-o", ".spz"},
               {{"trace", path("m.ply"), "--rays", path("rays.npy")}, "-o", ".npz"},
               {{"report", path("a")}, "-o", ".html"},
               {{"report", path("a"), path("b")}, "-o", ".html"},
               {{"render", path("m.ply"), "--orbit", "1", "--width", "8"}, "--video", ".gif"}};
    for (const char* option : {"--json", "--csv", "--html"})
      writers.push_back(
          {{"bench", "--sizes", "1k", "--resolution", "8x8", "--repeat", "1", "--filter", "^adam"},
           option,
           ".txt"});
  }
  std::string path(const std::string& name) const { return folder_ / name; }
  static Outcome run(const Writer& writer, const std::string& file, const Words& more = {}) {
    Words words = writer.command;
    words.insert(words.end(), {writer.option, file, "-q"});
    words.insert(words.end(), more.begin(), more.end());
    return raysplats_program(words);
  }
  /// Before anything is computed.
  static void check_refused(const Outcome& outcome, int code, const std::string& part) {
    check_refusal(outcome, code, part);
    CHECK(outcome.out.empty());
  }

  std::vector<Writer> writers;

 private:
  TemporaryFolder folder_;
};

}  // namespace

TEST_CASE("no command replaces a file that is there, unless it is told to") {
  const Place place;
  for (const Place::Writer& writer : place.writers) {
    const std::string file = place.path("out" + writer.ending);
    CAPTURE(writer.command.front());
    CAPTURE(writer.option);
    write_file(file, "mine");
    Place::check_refused(Place::run(writer, file), 2, "is there already");
    CHECK(read_file(file) == "mine");
    if (writer.command.front() != "bench") {  // takes seconds; bench_test.cpp
      const Outcome replaced = Place::run(writer, file, {"--overwrite"});
      INFO(replaced.err);
      CHECK(replaced.code == 0);
      CHECK(read_file(file) != "mine");
    }
    fs::remove(file);
    // Nor does a folder give way, whatever is said, and nothing is computed for it.
    fs::create_directories(file);
    for (const Words& more : {Words{}, Words{"--overwrite"}})
      Place::check_refused(Place::run(writer, file, more), 3, "is a folder");
    CHECK(fs::is_empty(file));
    fs::remove(file);
    Place::check_refused(Place::run(writer, ""), 2, "the name is empty");
  }
}

TEST_CASE("what is read is not written to") {
  const Place place;
  const std::string model = read_file(place.path("m.ply")),
                    rays = read_file(place.path("rays.npy"));
  fs::create_symlink("m.ply", place.path("link.ply"));
  const Place::Writer& trace = place.writers.at(1);
  for (const char* file : {"m.ply", "rays.npy", "link.ply"}) {
    Place::check_refused(Place::run(trace, place.path(file), {"--overwrite"}), 2,
                         "is what is read");
  }
  write_file(place.path("camera.json"),
             R"({"w":8,"h":8,"fl_x":8,"frames":[{"file_path":"a.png","transform_matrix":
               [[1,0,0,0],[0,1,0,0],[0,0,1,6],[0,0,0,1]]}]})");
  const Place::Writer bench{{"bench", "--model", place.path("m.ply"), "--cameras",
                             place.path("camera.json"), "--repeat", "1", "--filter", "^adam"},
                            "--json",
                            ""};
  Place::check_refused(Place::run(bench, place.path("link.ply"), {"--overwrite"}), 2,
                       "is what is read");
  CHECK(read_file(place.path("m.ply")) == model);
  CHECK(read_file(place.path("rays.npy")) == rays);

  // Of a run its options are read too.
  write_file(place.path("run/point_cloud/iteration_5/point_cloud.ply"), model);
  write_file(place.path("run/config.toml"), "seed = 7\n");
  const Place::Writer of_run{
      {"trace", place.path("run"), "--rays", place.path("rays.npy")}, "-o", ""};
  Place::check_refused(Place::run(of_run, place.path("run/config.toml"), {"--overwrite"}), 2,
                       "is what is read");
  CHECK(read_file(place.path("run/config.toml")) == "seed = 7\n");
}

TEST_CASE("convert refuses before it looks for what to keep") {
  const Place place;
  write_file(place.path("out.spz"), "mine");
  Place::check_refused(raysplats_program({"convert", place.path("m.ply"), place.path("out.spz"),
                                          "--max-gaussians", "2"}),
                       2, "is there already");
}

TEST_CASE("a run's own page is made anew, and its other files stay") {
  const Place place;
  const std::string page = place.path("a/report.html");
  for (const Words& more : {Words{}, Words{}, Words{"-o", page}}) {
    Words words{"report", place.path("a")};
    words.insert(words.end(), more.begin(), more.end());
    CHECK(raysplats_program(words).code == 0);
    CHECK(read_file(page).starts_with("<!DOCTYPE html>"));
  }
  write_file(place.path("a/config.toml"), "seed = 7\n");
  for (const char* read : {"a/metrics.json", "a/config.toml"}) {
    for (const Words& runs : {Words{place.path("a")}, Words{place.path("b"), place.path("a")}}) {
      Words words{"report", "-o", place.path(read), "--overwrite"};
      words.insert(words.end(), runs.begin(), runs.end());
      Place::check_refused(raysplats_program(words), 2, "is what is read");
    }
  }
  CHECK(read_file(place.path("a/metrics.json")) == "{}");
  CHECK(read_file(place.path("a/config.toml")) == "seed = 7\n");
  Place::check_refused(raysplats_program({"report", place.path("none")}), 3, "does not exist");
}

TEST_CASE("a page is not written over the evaluation that it shows") {
  const Place place;
  write_file(place.path("a/metrics.json"), R"({"evaluations":[{"iteration":5},{"iteration":60}]})");
  const std::string evaluation = place.path("a/eval/iteration_60/");
  for (const char* name : {"metrics.json", "0.png"}) {
    const std::string read = evaluation + name;
    write_file(read, "{}");
    for (const Words& runs : {Words{place.path("a")}, Words{place.path("b"), place.path("a")}}) {
      Place::check_refused(raysplats_program(Words{"report", "-o", read, "--overwrite"} + runs), 2,
                           "is what is read");
    }
    CHECK(read_file(read) == "{}");
  }
  const Words page{"report", place.path("a"), "-o", evaluation + "new.html", "--overwrite"};
  CHECK(raysplats_program(page).code == 0);
  CHECK(raysplats_program(page).code == 0);
}

TEST_CASE("bench refuses results that would be lost") {
  const Place place;
  const Place::Writer& json = place.writers.at(5);
  const std::string file = place.path("both.txt");
  Place::check_refused(Place::run(json, file, {"--csv", place.path("./both.txt")}), 2,
                       "--json and --csv both name");
  Place::check_refused(Place::run(json, file, {"--forecast"}), 2,
                       "--json does not go with --forecast");
  CHECK(!fs::exists(file));
}

TEST_CASE("an empty name is not the folder that one is in") {
  const TemporaryFolder folder;
  write_file(folder / "m.ply", ply_file(2));
  Surroundings here;
  here.folder = folder.path().string();
  for (const Words& words :
       {Words{"generate", ""}, Words{"train", "data", "-o", ""}, Words{"prepare", "data", "-o", ""},
        Words{"eval", "m.ply", "--data", "data", "-o", ""},
        Words{"render", "m.ply", "--orbit", "1", "-o", ""}, Words{"manual", ""}}) {
    CAPTURE(words.front());
    Place::check_refused(raysplats_program(words, here), 2, "the name is empty");
  }
  CHECK(entries(folder.path()) == 1);
}

TEST_CASE("no output folder is made before what is read") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", out = folder / "out";
  REQUIRE(raysplats_program(
              {"generate", data, "--size", "8", "--train-views", "2", "--test-views", "1", "-q"})
              .code == 0);
  write_file(folder / "m.ply", ply_file(2));
  const Words eval{"eval", folder / "m.ply", "--data", data, "-o", out, "-q", "--lpips"};
  for (const std::string& network : {folder / "none.onnx", data, folder / "m.ply"}) {
    Words words = eval;
    words.push_back(network);
    CHECK(raysplats_program(words).code != 0);
    CHECK(!fs::exists(out));
  }
  Place::check_refused(raysplats_program({"train", data, "-o", out, "--resume", folder / "none"}),
                       3, "does not exist");
  CHECK(!fs::exists(out));
}
