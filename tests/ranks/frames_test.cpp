// SPDX-License-Identifier: Apache-2.0
// Frames and evaluations that several ranks share.
#include <doctest/doctest.h>

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <string>

#include "ranks.hpp"
#include "tiny_run.hpp"

namespace {

// The files of a folder by their names.
std::map<std::string, std::string> files_of(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    files[entry.path().filename().string()] = read_file(entry.path());
  return files;
}

struct Orbit {
  TemporaryFolder folder;
  std::string model = folder / "model.ply";
  Orbit() { write_file(model, ply_file(40)); }
  Words command(const std::string& out) const {
    return {"render", model, "--orbit", "5", "--width", "48", "-o", folder / out, "--depth", "-q"};
  }
  Words evaluation(const std::string& out) const {
    return {"eval", model, "--data", tiny_data(), "--split", "all", "-o", folder / out, "-q"};
  }
};

// Two frames of a command, which is told a folder, are the same for more ranks than frames as for
// one; returns how many files they are.
std::size_t check_two_frames(const Orbit& orbit,
                             const std::string& name,
                             const std::function<Words(const std::string& out)>& command) {
  const std::string one = "one " + name;
  const Outcome alone = raysplats_program(command(one));
  INFO(alone.err);
  REQUIRE(alone.code == 0);
  const auto expected = files_of(orbit.folder / one);
  for (const std::string devices : {"0,0,0", "0,0,0,0,0,0,0"}) {
    CAPTURE(devices);
    const std::string out = name + " of " + devices;
    const Outcome shared = raysplats_program(command(out) + Words{"--device", devices});
    INFO(shared.err);
    REQUIRE(shared.code == 0);
    CHECK(contains(shared.out, "2 frames in"));
    CHECK(files_of(orbit.folder / out) == expected);
  }
  return expected.size();
}

}  // namespace

TEST_CASE("devices of a list share frames and views, and change neither") {
  const Orbit orbit;
  REQUIRE(raysplats_program(orbit.command("one")).code == 0);
  const auto expected = files_of(orbit.folder / "one");
  REQUIRE(expected.size() == 10);
  // More devices than frames leave some idle.
  for (const std::string devices : {"0,0", "0,0,0,0,0,0"}) {
    CAPTURE(devices);
    const Outcome shared = raysplats_program(orbit.command(devices) + Words{"--device", devices});
    INFO(shared.err);
    REQUIRE(shared.code == 0);
    CHECK(contains(shared.out, "5 frames in"));
    CHECK(files_of(orbit.folder / devices) == expected);
  }
  const Outcome one = raysplats_program(orbit.evaluation("eval one"));
  const Outcome two = raysplats_program(orbit.evaluation("eval two") + Words{"--device", "0,0"});
  INFO(two.err);
  REQUIRE(one.code == 0);
  REQUIRE(two.code == 0);
  CHECK(one.out == two.out);
  CHECK(files_of(orbit.folder / "eval one") == files_of(orbit.folder / "eval two"));
}

TEST_CASE("lists of devices that make no sense are refused") {
  const Orbit orbit;
  for (const auto& [devices, words] :
       std::map<std::string, std::string>{{"0,,0", "names nothing beside a comma"},
                                          {"0,", "names nothing beside a comma"},
                                          {"0,99", "counted from 0"},
                                          {"0,nothing of the kind", "no device has that"}}) {
    const Outcome outcome = raysplats_program(orbit.command("no") + Words{"--device", devices});
    INFO(outcome.err);
    CHECK(outcome.code == 2);
    CHECK(one_sentence(outcome));
    CHECK(contains(outcome.err, words));
  }
}

TEST_CASE("ranks draw bands of a frame where there are fewer frames than ranks") {
  const Orbit orbit;
  // Bands of whole tiles, of none, ray by ray, averaged samples and moments; layers beside colours.
  const std::vector<Words> ways{{"--depth", "--normals", "--hits"},
                                {"--traversal", "bvh", "--depth"},
                                {"--supersample", "2", "--shutter-samples", "2", "--depth"},
                                {"--format", "exr"}};
  for (std::size_t i = 0; i < ways.size(); ++i) {
    CAPTURE(i);
    const auto command = [&](const std::string& out) {
      return Words{"render", orbit.model, "--orbit",          "2", "--width",
                   "70",     "-o",        orbit.folder / out, "-q"} +
             ways[i];
    };
    check_two_frames(orbit, std::to_string(i), command);
  }
}

TEST_CASE("ranks draw bands of a scene with meshes where there are fewer frames than ranks") {
  const Orbit orbit;
  write_file(orbit.folder / "floor.obj",
             "v -2 1 -2\nv 2 1 -2\nv 2 1 2\nv -2 1 2\nf 1 2 3\nf 1 3 4\n");
  const std::string scene =
      "[[model]]\nfile = \"model.ply\"\n"
      "[[mesh]]\nfile = \"floor.obj\"\nmaterial = \"chrome\"\nmove = [0.2, 0, 0]\n"
      "[[material]]\nname = \"chrome\"\nkind = \"mirror\"\n"
      "[[light]]\nkind = \"sphere\"\nposition = [1, -3, -2]\nradius = 0.3\n"
      "[camera]\nposition = [0.5, -1, -6]\ntarget = [0, 0, 0]\nwidth = 70\nheight = 50\n"
      "[animation]\nframes = 2\n";
  // In packets, and ray by ray with shadows and several samples.
  const std::vector<std::string> ways{"[render.shadows]\nstrength = 0\n",
                                      "[render]\nsamples = 3\n"};
  for (std::size_t i = 0; i < ways.size(); ++i) {
    CAPTURE(i);
    const std::string file = orbit.folder / ("scene " + std::to_string(i) + ".toml");
    write_file(file, scene + ways[i]);
    const auto command = [&](const std::string& out) {
      return Words{"render", file, "-o", orbit.folder / out, "-q"};
    };
    REQUIRE(check_two_frames(orbit, std::to_string(i), command) == 2);
  }
}

TEST_CASE("ranks draw bands of an evaluated view where there are fewer views than ranks") {
  const Orbit orbit;
  const auto command = [&](const std::string& out) {
    return Words{"eval", orbit.model, "--data", tiny_data(), "-o", orbit.folder / out, "-q"};
  };
  const Outcome one = raysplats_program(command("one"));
  INFO(one.err);
  REQUIRE(one.code == 0);
  for (const std::string devices : {"0,0", "0,0,0,0,0"}) {
    CAPTURE(devices);
    const Outcome shared = raysplats_program(command(devices) + Words{"--device", devices});
    INFO(shared.err);
    REQUIRE(shared.code == 0);
    CHECK(shared.out == one.out);
    CHECK(files_of(orbit.folder / devices) == files_of(orbit.folder / "one"));
  }
}

TEST_CASE("a video is for one rank") {
  const Orbit orbit;
  const Outcome outcome =
      raysplats_program({"render", orbit.model, "--orbit", "3", "--width", "48", "--video",
                         orbit.folder / "a.gif", "--device", "0,0", "-q"});
  CHECK(outcome.code == 2);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "--video is written by one rank"));
  CHECK_FALSE(std::filesystem::exists(orbit.folder / "a.gif"));
}

MPI_TEST_CASE("processes of mpirun share frames and views, and change neither") {
  const Orbit orbit;
  REQUIRE(raysplats_program(orbit.command("one")).code == 0);
  const Outcome one = raysplats_program(orbit.evaluation("eval one"));
  for (const int ranks : {2, 4}) {
    CAPTURE(ranks);
    const std::string frames = "frames " + std::to_string(ranks);
    const Outcome shared = raysplats_program(orbit.command(frames), mpirun(ranks));
    INFO(shared.err);
    REQUIRE(shared.code == 0);
    CHECK(contains(shared.out, "5 frames in"));
    CHECK(files_of(orbit.folder / frames) == files_of(orbit.folder / "one"));
    const std::string eval = "eval " + std::to_string(ranks);
    const Outcome judged = raysplats_program(orbit.evaluation(eval), mpirun(ranks));
    CHECK(judged.out == one.out);
    CHECK(files_of(orbit.folder / eval) == files_of(orbit.folder / "eval one"));
  }
}

MPI_TEST_CASE("what is wrong for all processes is said once") {
  const Orbit orbit;
  const Outcome missing = raysplats_program(
      {"render", orbit.folder / "none.ply", "--orbit", "2", "-o", orbit.folder / "out", "-q"},
      mpirun(3));
  INFO(missing.err);
  CHECK(missing.code == 3);
  CHECK(sentences(missing.err) == 1);
  CHECK(contains(missing.err, "none.ply"));
  const Outcome single = raysplats_program({"info", orbit.model}, mpirun(3));
  INFO(single.err);
  CHECK(single.code == 2);
  CHECK(sentences(single.err) == 1);
  CHECK(contains(single.err, "'raysplats info' works in one process, and mpirun has started 3"));
}

TEST_CASE("a program that cannot join the processes of mpirun says so") {
  const Orbit orbit;
  Surroundings launched;
  launched.environment = {{"OMPI_COMM_WORLD_SIZE", "2"},
                          {"OMPI_COMM_WORLD_RANK", "0"},
                          {"RAYSPLATS_MPI_LIBRARY", orbit.folder / "none.so"}};
  const Outcome outcome = raysplats_program(orbit.command("out"), launched);
  CHECK(one_sentence(outcome));
  if (kHaveMpi) {
    CHECK(outcome.code == 1);
    CHECK(contains(outcome.err, "none.so"));
  } else {
    CHECK(outcome.code == 2);
    CHECK(contains(outcome.err, "was built without MPI, and each of the 2 processes"));
  }
  // The other one leaves the word to the first.
  launched.environment[1].second = "1";
  const Outcome other = raysplats_program(orbit.command("out"), launched);
  CHECK(other.code == outcome.code);
  CHECK(other.err.empty());
}
