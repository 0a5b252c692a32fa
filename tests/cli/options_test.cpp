// SPDX-License-Identifier: Apache-2.0
// Options that would do nothing, ranges that are the same everywhere, advice that helps.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

void refuse(const Words& arguments, const std::string& message) {
  check_refused(arguments, 2, message);
}

const Words kRender{"render", "m.ply", "-o", "x", "--orbit", "2"};

}  // namespace

TEST_CASE("options that would do nothing are refused") {
  refuse(kRender + Words{"--split", "train"}, "--data");
  refuse(kRender + Words{"--test-every", "3"}, "--data");
  refuse(kRender + Words{"--no-undistort"}, "--data");
  refuse(kRender + Words{"--downscale", "2"}, "--width");
  refuse(kRender + Words{"--data", "d", "--split", "all"}, "goes around all");
  refuse(kRender + Words{"--distance", "0"}, "--distance");
  refuse(kRender + Words{"--camera-model", "equirectangular", "--fov", "90"}, "--fov");
  refuse({"render", "m.ply", "-o", "x", "--cameras", "c.json", "--split", "all"}, "--data");
  for (const Words& words : {Words{"--sizes", "1k"}, Words{"--large"}, Words{"--scene", "surface"},
                             Words{"--sh-degree", "1"}}) {
    refuse(Words{"bench", "--model", "m.ply", "--cameras", "c.json"} + words, words[0]);
  }
  refuse({"bench", "--view", "1"}, "--model");
  refuse({"tune", "--reset", "--dry-run"}, "--dry-run");
}

TEST_CASE("generate takes its folder by -o, as the other commands do") {
  const TemporaryFolder folder;
  const Words small{"--size", "8", "--train-views", "1", "--test-views", "1", "-q"};
  CHECK(raysplats_program(Words{"generate", "-o", folder / "data"} + small).code == 0);
  CHECK(std::filesystem::exists(folder / "data/transforms_train.json"));
  CHECK(raysplats_program(Words{"generate", folder / "more"} + small).code == 0);
  CHECK(std::filesystem::exists(folder / "more/transforms_train.json"));
}

TEST_CASE("a scene's [camera] without an angle takes none from the command line") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  for (const std::string camera :
       {"model = \"equirectangular\"\n", "model = \"orthographic\"\nextent = 2\n"}) {
    write_file(folder / "scene.toml",
               "[[model]]\nfile = \"balls.ply\"\n[camera]\norbit = { frames = 1 }\n" + camera);
    refuse(
        {"render", folder / "scene.toml", "-o", folder / "x", "--orbit", "1", "--fov", "40", "-q"},
        "--fov");
  }
}

TEST_CASE("one side of an orbit's pictures keeps their shape") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  const auto size = [&](const Words& words) {
    const std::string output = folder / "frames";
    std::filesystem::remove_all(output);
    const Outcome outcome = raysplats_program(
        Words{"render", folder / "balls.ply", "--orbit", "1", "-q", "-o", output} + words);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    const raysplats::Image image = raysplats::read_image(output + "/frame_0000.png");
    return std::pair(image.width, image.height);
  };
  CHECK(size({"--width", "24"}) == std::pair(24, 24));
  CHECK(size({"--height", "24"}) == std::pair(24, 24));
  CHECK(size({"--width", "24", "--height", "10"}) == std::pair(24, 10));
  const Words panorama{"--camera-model", "equirectangular"};
  CHECK(size(panorama + Words{"--width", "24"}) == std::pair(24, 12));
  CHECK(size(panorama + Words{"--height", "12"}) == std::pair(24, 12));
  CHECK(size({"--camera-model", "fisheye", "--fov", "360", "--width", "16"}) == std::pair(16, 16));
}

TEST_CASE("an orbit of a run goes as its photos do, and says where none was taken") {
  const TemporaryFolder folder;
  const std::string run = folder / "run", model = run + "/point_cloud/iteration_1/point_cloud.ply";
  std::filesystem::create_directories(run + "/point_cloud/iteration_1");
  write_file(model, ply_file(2));
  const auto orbit = [&](const std::string& photos) {
    write_file(run + "/cameras.json", photos);
    const Outcome outcome = succeed({"render", run, "--orbit", "8", "-o", folder / "frames",
                                     "--overwrite", "--log-level", "warn"});
    const raysplats::Image image = raysplats::read_image(folder / "frames/frame_0000.png");
    CHECK(image.width == 24);
    CHECK(image.height == 16);
    return outcome.err;
  };
  const auto photo = [](const std::string& place, const std::string& rotation) {
    return "{\"img_name\": \"a\", \"width\": 24, \"height\": 16, \"fx\": 20, \"fy\": 20, "
           "\"position\": " +
           place + ", \"rotation\": " + rotation + "}";
  };
  const std::string ahead = "[[1,0,0],[0,1,0],[0,0,1]]", back = "[[-1,0,0],[0,1,0],[0,0,-1]]";
  const std::string right = "[[0,0,1],[0,1,0],[-1,0,0]]", left = "[[0,0,-1],[0,1,0],[1,0,0]]";
  // Four photos around the balls, then all of them along one line.
  CHECK_FALSE(contains(orbit("[" + photo("[0,0,-4]", ahead) + "," + photo("[0,0,4]", back) + "," +
                             photo("[-4,0,0]", right) + "," + photo("[4,0,0]", left) + "]"),
                       "no photo was taken"));
  CHECK(contains(orbit("[" + photo("[0,0,-4]", ahead) + "," + photo("[0,0,-3]", ahead) + "," +
                       photo("[0,0,-2]", ahead) + "]"),
                 "frames of the orbit look from where no photo was taken"));
  // A damaged list costs the photos, not the orbit.
  write_file(run + "/cameras.json", "[{");
  CHECK(contains(succeed({"render", run, "--orbit", "1", "--width", "16", "-o", folder / "more",
                          "--log-level", "warn"})
                     .err,
                 "the orbit has no cameras of the run"));
}

TEST_CASE("ranges are the same on the command line, in [trace] and in configurations") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  struct Case {
    std::string option, key, value, range;
  };
  const std::vector<Case> cases{
      {"--q", "quantile", "0.001", "from 0.01 to 100"},
      {"--quantile", "q", "101", "from 0.01 to 100"},
      {"--min-transmittance", "min-transmittance", "0.6", "from 0 to 0.5"},
      {"--max-hits", "max-hits", "0", "from 1 to 1000000"},
      {"--memory-budget", "memory-budget", "-1", "from 0 to 1000000000"},
      {"--background", "background", "2", "from 0 to 1"}};
  for (const auto& [option, key, value, range] : cases) {
    INFO(option);
    refuse(kRender + Words{option, value}, range);
    const std::string line = key == "background" ? "[2, 0, 0]" : value;
    write_file(folder / "scene.toml", "[[model]]\nfile = \"balls.ply\"\n[trace]\n" + key + " = " +
                                          line + "\n[camera]\norbit = { frames = 1 }\n");
    refuse({"render", folder / "scene.toml", "-o", folder / "x"}, range);
    if (key == "q" || key == "background") continue;
    refuse({"train", "d", "-o", folder / "x", "--" + key, value}, range);
  }
  refuse({"train", "d", "-o", folder / "x", "--adam-beta2", "1"}, "from 0 to 0.9999999");
  refuse(kRender + Words{"--background", "-1"}, "from 0 to 1");
  for (const Words& command : {Words{"render", "s.toml", "-o", "x"}, Words{"generate", "x"},
                               Words{"train", "d", "-o", "x"}}) {
    refuse(command + Words{"--seed", "-1"}, "a whole number");
    refuse(command + Words{"--seed", "18446744073709551616"}, "a whole number");
  }
}

TEST_CASE("ranges are the same on the command line, in [render] and in [camera]") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  const auto scene = [&](const std::string& more) {
    write_file(folder / "scene.toml", "[[model]]\nfile = \"balls.ply\"\n" + more);
    return Words{"render", folder / "scene.toml", "-o", folder / "x", "-q"};
  };
  const std::string camera = "[camera]\norbit = { frames = 1 }\n";
  struct Case {
    std::string key, value, range;
  };
  for (const auto& [key, value, range] :
       std::vector<Case>{{"samples", "65537", "from 1 to 65536"},
                         {"samples", "0", "from 1 to 65536"},
                         {"max-bounces", "1001", "from 1 to 1000"},
                         {"seed", "-1", "a whole number"}}) {
    INFO(key);
    refuse(scene(camera) + Words{"--" + key, value}, range);
    refuse(scene(camera + "[render]\n" + key + " = " + value + "\n"), range);
  }
  for (const auto& [key, value, range] : std::vector<Case>{{"width", "1048577", "1 to 1048576"},
                                                           {"height", "1048577", "1 to 1048576"},
                                                           {"fov", "0.0001", "0.001 to 360"}}) {
    INFO(key);
    refuse(kRender + Words{"--" + key, value}, range);
    refuse(scene(camera + "model = \"fisheye\"\n" + key + " = " + value + "\n"), range);
  }
  // What a plane can show ends earlier, which only the lens tells.
  write_file(folder / "model.ply", ply_file(2));
  refuse({"render", folder / "model.ply", "-o", folder / "x", "--orbit", "1", "--fov", "179.95"},
         "from 0.001 to 179.9");
  refuse(scene(camera + "fov = 179.95\n"), "0.001 to 179.9");
  refuse(scene(camera + "[trace]\nnear = -1\n"), "at least 0");
  refuse(kRender + Words{"--near", "-1"}, "at least 0");
}

TEST_CASE("keys that another kind has are no typing errors") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  const auto scene = [&](const std::string& more) {
    write_file(folder / "scene.toml",
               "[[model]]\nfile = \"balls.ply\"\n[camera]\norbit = { frames = 1 }\n" + more);
    return Words{"render", folder / "scene.toml", "-o", folder / "x", "--width", "8", "-q"};
  };
  const std::string mirror = "[[material]]\nname = \"m\"\nkind = \"mirror\"\n";
  refuse(scene(mirror + "ior = 1.5\n"), "'ior' is for kind = \"glass\"");
  refuse(scene(mirror + "opacity = 0.5\n"), "'opacity' is for kind = \"transparent\"");
  refuse(scene("[trace]\nnear = 1\n"), "'near' in [trace] can only be 0");
  const Outcome fine = raysplats_program(scene(
      mirror +
      "color = 0.5\n[trace]\nq = 9\nnear = 0\ntraversal = \"bvh\"\n[environment]\ncolor = 0.25\n"
      "[[light]]\nkind = \"point\"\nposition = [0, 0, 9]\nintensity = 1e12\n"));
  INFO(fine.err);
  CHECK(fine.code == 0);
}

TEST_CASE("a result of bench without a place to go is refused before anything is measured") {
  const TemporaryFolder folder;
  write_file(folder / "file", "in the way");
  const Outcome outcome = raysplats_program({"bench", "--json", folder / "file/result.json", "-q"});
  CHECK(outcome.code == 3);
  CHECK(one_sentence(outcome));
}

TEST_CASE("tune --reset removes a tuning that cannot be read") {
  const TemporaryFolder cache;
  const Surroundings there{{{"XDG_CACHE_HOME", cache.path().string()}}};
  const std::string file = (cache.path() / "raysplats" / "tuning.json").string();
  write_file(file, "{ broken");
  const Outcome outcome = raysplats_program({"tune", "--reset"}, there);
  CHECK(outcome.code == 0);
  CHECK_FALSE(std::filesystem::exists(file));
}

TEST_CASE("masks beside the photos are shown") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  REQUIRE(raysplats_program(
              {"generate", data, "--size", "8", "--train-views", "2", "--test-views", "1", "-q"})
              .code == 0);
  CHECK(raysplats_program({"info", data}).out.find("masks") == std::string::npos);
  std::filesystem::create_directories(data + "/masks/train");
  std::filesystem::copy_file(data + "/train/r_0.png", data + "/masks/train/r_0.png");
  const Outcome info = raysplats_program({"info", data});
  CHECK(info.out.find("masks            ") != std::string::npos);
  CHECK(info.err.find("have a mask, as ") != std::string::npos);
}
