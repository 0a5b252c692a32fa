// SPDX-License-Identifier: Apache-2.0
// What new users tried and tripped over.
#include <doctest/doctest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../skip_test.hpp"
#include "program.hpp"

namespace fs = std::filesystem;

namespace {

/// A data set of a few tiny photos, made once.
const std::string& data() {
  static const TemporaryFolder folder;
  static const std::string path = [] {
    succeed({"generate", folder / "data", "--size", "16", "--train-views", "3", "--test-views", "2",
             "-q"});
    return folder / "data";
  }();
  return path;
}

Words training(const std::string& run, int iterations) {
  return {"train",
          data(),
          "-o",
          run,
          "-n",
          std::to_string(iterations),
          "--init-count",
          "50",
          "--sh-degree",
          "0",
          "--densify-until",
          "0",
          "--resolution-schedule",
          "[]",
          "-q"};
}

std::string checkpoint(const std::string& run, const std::string& iteration) {
  return run + "/checkpoints/step_" + std::string(9 - iteration.size(), '0') + iteration + ".rsck";
}

/// Every file below a folder with its bytes.
std::string content(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file() && entry.path().filename() != ".lock")
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  std::string out;
  for (const fs::path& file : files) out += file.string() + "\n" + read_file(file) + "\n";
  return out;
}

}  // namespace

TEST_CASE("a new run does not mix with an older and longer one") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  succeed(training(run, 8) + Words{"--checkpoint-every", "4"});
  write_file(run + "/notes.txt", "mine");
  const std::string before = content(run);
  check_refused(training(run, 2), 2, "holds another run (iteration 8)");
  check_refused(training(run, 2), 2, "--overwrite");
  CHECK(content(run) == before);
  // Nor does a run that is resumed from elsewhere.
  const std::string other = folder / "other";
  succeed(training(other, 2));
  check_refused(training(run, 4) + Words{"--resume", other}, 2, "holds another run");
  CHECK(content(run) == before);

  succeed(training(run, 2) + Words{"--overwrite"});
  CHECK(fs::exists(checkpoint(run, "2")));
  CHECK_FALSE(fs::exists(checkpoint(run, "4")));
  CHECK_FALSE(fs::exists(checkpoint(run, "8")));
  CHECK_FALSE(fs::exists(run + "/point_cloud/iteration_8"));
  CHECK_FALSE(fs::exists(run + "/eval/iteration_8"));
  CHECK(read_file(run + "/notes.txt") == "mine");
  const nlohmann::json info = nlohmann::json::parse(raysplats_program({"info", run, "--json"}).out);
  CHECK(info.at("iteration") == 2);
  CHECK(info.at("iterations") == 2);
  succeed(training(run, 3) + Words{"--resume", "latest"});
  CHECK(fs::exists(checkpoint(run, "3")));
}

TEST_CASE("a run goes back to an earlier checkpoint only where it may drop what came after") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const Words often{"--checkpoint-every", "2", "--keep-checkpoints", "3"};
  succeed(training(run, 6) + often);
  const std::string before = content(run);
  const Words back = training(run, 5) + Words{"--resume", checkpoint(run, "2")} + often;
  check_refused(back, 2, "has gone on to step_000000006.rsck");
  CHECK(content(run) == before);
  succeed(back + Words{"--overwrite"});
  CHECK(fs::exists(checkpoint(run, "2")));
  CHECK(fs::exists(checkpoint(run, "5")));
  CHECK_FALSE(fs::exists(checkpoint(run, "6")));
  CHECK_FALSE(fs::exists(run + "/point_cloud/iteration_6"));
}

TEST_CASE("a checkpoint that cannot be read does not cost the run its new ones") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  succeed(training(run, 4) + Words{"--checkpoint-every", "2"});
  write_file(checkpoint(run, "9"), "broken");
  succeed(training(run, 6) + Words{"--resume", run, "--checkpoint-every", "1", "--keep-checkpoints",
                                   "1", "--log-level", "off"});
  CHECK(fs::exists(checkpoint(run, "6")));
}

TEST_CASE("a run is resumed with the photos that it was trained on") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  succeed(training(run, 2));
  check_refused(training(run, 4) + Words{"--resume", run, "--downscale", "2"}, 2,
                "'downscale' = 1, not 2");
  check_refused(training(run, 4) + Words{"--resume", run, "--no-undistort"}, 2, "'undistort'");
  check_refused(training(run, 4) + Words{"--resume", run, "--test-every", "3"}, 2, "'test-every'");
  succeed(training(run, 4) + Words{"--resume", run});
}

TEST_CASE("a run holds out what its list names, whatever becomes of the file") {
  const TemporaryFolder folder;
  const std::string run = folder / "run", list = folder / "list.txt";
  const auto held_out = [&](const Words& more) {
    const std::string out = folder / "eval";
    succeed(Words{"eval", run, "--data", data(), "-o", out, "--overwrite", "-q"} + more);
    std::vector<std::string> names;
    const auto metrics = nlohmann::json::parse(read_file(out + "/metrics.json"));
    for (const auto& image : metrics.at("images")) names.push_back(image.at("name"));
    return names;
  };
  write_file(list, "# published\nr_1.png\ntrain/r_2\n");
  const Words listed = Words{"--test-list", list};
  check_refused(training(run, 2) + listed, 2, "1 of 2 names");
  write_file(list, "# published\ntest/r_1.png\ntrain/r_2\n");
  succeed(training(run, 2) + listed);
  CHECK(contains(read_file(run + "/config.toml"),
                 "\ntest-list = '''\ntest/r_1.png\ntrain/r_2\n'''\n"));
  write_file(list, "test/r_1.png\n");
  succeed(training(run, 4) + Words{"--resume", run});
  CHECK(held_out({}) == std::vector<std::string>{"test/r_1.png", "train/r_2.png"});
  CHECK(held_out(listed) == std::vector<std::string>{"test/r_1.png"});
  CHECK(held_out({"--test-every", "8"}) ==
        std::vector<std::string>{"test/r_0.png", "test/r_1.png"});
  check_refused(training(run, 6) + Words{"--resume", run} + listed, 2, "other photos held out");
  write_file(list, "r_2.png\ntest/r_1\n");
  succeed(training(run, 6) + Words{"--resume", run} + listed);
  check_refused(training(run, 8) + Words{"--resume", run, "--test-every", "8"}, 2,
                "cameras and 'test-list' or 'test-every' of the run");

  write_file(folder / "every.toml", "test-every = 8\n");
  check_refused(training(run, 8) + Words{"--resume", run, "--config", folder / "every.toml"}, 2,
                "cameras and 'test-list' or 'test-every' of the run");

  const std::string strange = folder / "strange";  // without the photos that the list names
  succeed({"generate", strange, "--train-views", "2", "--test-views", "1", "--size", "24", "-q"});
  const Words render{"render", run, "--data", strange, "-o", folder / "frames", "-q"};
  check_refused(render, 2, "in the list of test photos mean no photo of");
  succeed(render + Words{"--split", "all"});

  const std::string other = folder / "other";
  for (const Words& command : {training(other, 2), Words{"info", data()},
                               Words{"eval", run, "--data", data(), "-o", other}})
    check_refused(command + listed + Words{"--test-every", "4"}, 2, "contradict each other");
  check_refused({"render", run, "-o", other, "--orbit", "2", "--test-list", list}, 2, "--data");
  CHECK(contains(succeed(Words{"info", data()} + listed).out, "4: 2 to train, 2 to test"));
  check_refused(Words{"info", run} + listed, 2, "--test-list is about");
  write_file(list, "");
  CHECK(contains(succeed(Words{"info", data()} + listed).out, "3: 3 to train, 0 to test"));
  write_file(list, "r_2\ntrain/r_0\ntrain/r_1\ntest/r_0\ntest/r_1\n");
  check_refused(training(other, 2) + listed, 2, "the list of test photos names all of them");
  CHECK_FALSE(fs::exists(other));
}

TEST_CASE("a run that is resumed at or beyond its end writes what it reports") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const std::string other = folder / "other";
  succeed(training(run, 4));
  check_refused(training(other, 2) + Words{"--resume", run}, 2, "at iteration 4 already");
  CHECK_FALSE(fs::exists(other + "/point_cloud"));
  succeed(training(other, 4) + Words{"--resume", run});
  const std::string model = "/point_cloud/iteration_4/point_cloud.ply";
  REQUIRE(fs::exists(other + model));
  CHECK(read_file(other + model) == read_file(run + model));
  CHECK(fs::exists(checkpoint(other, "4")));
  CHECK(fs::exists(other + "/eval/iteration_4/metrics.json"));
}

TEST_CASE("outputs do not go into the data set") {
  const TemporaryFolder folder;
  succeed({"generate", folder / "data", "--size", "16", "--train-views", "3", "--test-views", "2",
           "-q"});
  const std::string set = folder / "data";
  write_file(folder / "model.ply", ply_file(2));
  const std::string before = content(set);
  const std::string model = folder / "model.ply";
  for (const std::string& output : {set, set + "/test", set + "/."}) {
    check_refused({"train", set, "-o", output, "-n", "1", "-q"}, 2, "belongs to the data set");
    check_refused({"eval", model, "--data", set, "-o", output, "-q"}, 2, "belongs to the data set");
    check_refused({"render", model, "--data", set, "-o", output, "-q"}, 2,
                  "belongs to the data set");
    check_refused({"render", model, "--cameras", set + "/transforms_test.json", "-o", output, "-q"},
                  2, "belongs to the data set");
  }
  CHECK(content(set) == before);
  // A data set of somebody else.
  write_file(folder / "photos/transforms_train.json", "{\"frames\": []}");
  check_refused({"generate", folder / "photos", "--size", "8", "-q"}, 2, "--overwrite");
  CHECK(read_file(folder / "photos/transforms_train.json") == "{\"frames\": []}");
  succeed({"generate", set, "--size", "16", "--train-views", "3", "--test-views", "2", "-q"});
  CHECK(content(set) == before);
}

TEST_CASE("eval leaves the run's own figures alone") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  succeed(training(run, 2));
  const std::string before = content(run);
  check_refused({"eval", run, "--data", data(), "-o", run, "-q"}, 2, "metrics.json would be lost");
  CHECK(content(run) == before);
  succeed({"eval", run, "--data", data(), "-o", run + "/eval", "-q"});
}

TEST_CASE("eval shows as many views as it is asked for, beside none of before") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  const std::string out = folder / "eval";
  const auto eval = [&](const Words& more) {
    return Words{"eval", folder / "model.ply", "--data", data(), "-o", out, "-q"} + more;
  };
  succeed(eval({"--pictures", "0"}));
  CHECK(entries(out) == 1);  // metrics.json
  succeed(eval({"--pictures", "1"}));
  succeed(eval({"--pictures", "1"}));
  CHECK(entries(out) == 2);
  write_file(out + "/other.png", "mine");
  const std::string before = content(out);
  check_refused(eval({"--pictures", "1"}), 2, "that would stay beside the new ones");
  CHECK(content(out) == before);
  std::filesystem::remove(out + "/other.png");
  succeed(eval({"--pictures", "9"}));  // of two views
  CHECK(entries(out) == 3);
  succeed(eval({}));
  CHECK(entries(out) == 3);
}

TEST_CASE("fewer frames do not mix with more of before") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  const std::string frames = folder / "frames";
  const auto render = [&](const std::string& count, const Words& more = {}) {
    return Words{"render",      folder / "model.ply",
                 "--orbit",     count,
                 "--width",     "16",
                 "--height",    "16",
                 "-o",          frames,
                 "--log-level", "warn"} +
           more;
  };
  succeed(render("3"));
  succeed(render("3"));
  const std::string before = content(frames);
  check_refused(render("2"), 2, "the picture frame_0002.png");
  CHECK(content(frames) == before);
  const Outcome outcome = raysplats_program(render("1", {"--overwrite"}));
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.err, "2 pictures (frame_0001.png to frame_0002.png)"));
  CHECK(entries(frames) == 3);

  // Parts of one animation do go together.
  write_file(
      folder / "scene.toml",
      "[[model]]\nfile = \"model.ply\"\n[camera]\nposition = [0.5, 0, -6]\ntarget = [0.5, 0, "
      "0]\nwidth = 16\n[animation]\nframes = 4\n");
  const std::string parts = folder / "parts";
  const auto part = [&](const std::string& range) {
    return Words{"render", folder / "scene.toml", "--frames", range, "-o", parts, "-q"};
  };
  succeed(part("2:"));
  succeed(part("0:2"));
  CHECK(entries(parts) == 4);
  write_file(parts + "/frame_0004.png", "");
  check_refused(part("0:1"), 2, "frame_0004.png");
}

TEST_CASE("every spelling of a list on the command line gives the same list") {
  const TemporaryFolder folder;
  int count = 0;
  const auto config = [&](const Words& words) {
    const std::string run = folder / ("run" + std::to_string(count++));
    // The data set behind the list: it is no part of it.
    succeed(Words{"train", "-o", run, "-n", "1", "--init-count", "20", "--sh-degree", "0", "-q"} +
            words + Words{data()});
    return read_file(run + "/config.toml");
  };
  const std::string all =
      config({"--save-at", "5", "10", "15", "--eval-at=[5,10]", "--resolution-schedule", "=[300,",
              "1000]", "--background", "1", "0.5", "0"});
  CHECK(contains(all, "\nsave-at = [5, 10, 15]\n"));
  CHECK(contains(all, "\neval-at = [5, 10]\n"));
  CHECK(contains(all, "\nresolution-schedule = [\"4:300\", \"2:1000\"]\n"));
  CHECK(contains(all, "\nbackground = \"1,0.5,0\"\n"));
  const std::string more = config({"--save-at", "5", "--save-at", "10", "--eval-at", "[]",
                                   "--resolution-schedule", "4:300", "2:1000"});
  CHECK(contains(more, "\nsave-at = [5, 10]\n"));
  CHECK(contains(more, "\neval-at = []\n"));
  CHECK(contains(more, "\nresolution-schedule = [\"4:300\", \"2:1000\"]\n"));
  check_refused({"train", data(), "-o", folder / "none", "--save-at", "5,,10"}, 2, "save-at");
  check_refused({"train", data(), "-o", folder / "none", "--save-at", "[5"}, 2, "save-at");
}

TEST_CASE("what is no configuration is refused") {
  const TemporaryFolder folder;
  fs::create_directories(folder / "folder");
  write_file(folder / "broken.toml", "\xff\xfe");
  for (const char* name : {"folder", "broken.toml"}) {
    check_refused({"train", data(), "-o", folder / "run", "--config", folder / name}, 2, name);
  }
  write_file(folder / "table.toml", "[optimizer]\nposition-lr = 1\n");
  check_refused({"train", data(), "-o", folder / "run", "--config", folder / "table.toml"}, 2,
                "[optimizer]");
  CHECK_FALSE(fs::exists(folder / "run"));
}

TEST_CASE("closed standard streams harm no file") {
  const TemporaryFolder folder;
  Surroundings both;
  both.closed_out = both.closed_err = true;
  Words train = training(folder / "run", 2);
  train.pop_back();  // log lines are what would go astray
  CHECK(raysplats_program(train, both).code == 0);
  const std::string lock = read_file(folder / "run/.lock");
  CHECK(lock.find_first_not_of("0123456789\n") == std::string::npos);
  CHECK(fs::exists(checkpoint(folder / "run", "2")));
  Surroundings silent;
  silent.closed_err = true;
  const Outcome refused = raysplats_program({"info", folder / "none"}, silent);
  CHECK(refused.code == 3);
}

TEST_CASE("results that cannot be written are a failure") {
  Surroundings full;
  full.out_file = "/dev/full";
  SKIP_TEST_UNLESS(fs::exists(full.out_file), "there is no /dev/full");
  for (const Words& words : {Words{"info", data()}, Words{"--help"}, Words{"--version"},
                             Words{"info", data(), "--json"}, Words{"train", "-h"}}) {
    check_refusal(raysplats_program(words, full), 3, "Standard output cannot be written: ");
  }
  // Log lines are no results.
  const TemporaryFolder folder;
  Surroundings mute;
  mute.err_file = "/dev/full";
  Words train = training(folder / "run", 2);
  train.pop_back();
  CHECK(raysplats_program(train, mute).code == 0);
}

TEST_CASE("a run that learns nothing says so") {
  const TemporaryFolder folder;
  const auto metrics = [&](const std::string& run) {
    return nlohmann::json::parse(read_file(run + "/metrics.json"));
  };
  Words still = training(folder / "still", 40);
  still.pop_back();
  for (const char* rate : {"--position-lr", "--rotation-lr", "--scale-lr", "--opacity-lr",
                           "--sh-lr", "--sh-rest-lr"}) {
    still = still + Words{rate, "0", std::string(rate) + "-final", "0"};
  }
  const Outcome outcome = raysplats_program(still + Words{"--log-every", "1"});
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.err, "the model learned nothing"));
  CHECK(metrics(folder / "still").at("psnr_rise").get<double>() < 0.1);

  Words learning = training(folder / "learns", 40);
  learning.pop_back();
  const Outcome fine = raysplats_program(learning + Words{"--log-every", "1"});
  CHECK(fine.code == 0);
  CHECK_FALSE(contains(fine.err, "learned nothing"));
  CHECK(metrics(folder / "learns").at("psnr_rise").get<double>() > 0.1);
}

TEST_CASE("where no device is found the cause is named") {
  const TemporaryFolder folder;
  const auto refuse_there = [](const Surroundings& there, const Words& arguments, int code,
                               const Words& parts) {
    const Outcome outcome = raysplats_program(arguments, there);
    INFO(outcome.err);
    CHECK(outcome.code == code);
    CHECK(one_sentence(outcome));
    for (const std::string& part : parts) CHECK(contains(outcome.err, part));
  };
  const Words devices{"devices"};
  refuse_there({{{"OCL_ICD_VENDORS", "/nonexistent"}}}, devices, 4,
               {"registered in /nonexistent", "OCL_ICD_VENDORS", "pocl-opencl-icd"});
  write_file(folder / "broken/none.icd", "libnone_of_that_name.so\n");
  refuse_there({{{"OCL_ICD_VENDORS", folder / "broken"}}}, devices, 4,
               {"none.icd", "libnone_of_that_name.so"});

  const bool pocl = contains(raysplats_program(devices).out, "Portable Computing Language");
  SKIP_TEST_UNLESS(pocl, "there is no PoCL, which the rest is about");
  for (const char* name : {"POCL_CACHE_DIR", "XDG_CACHE_HOME"}) {
    refuse_there({{{name, "/proc/none"}}}, devices, 4,
                 {"the folder /proc/none", name, "cannot be written"});
  }
  refuse_there({{{"POCL_CACHE_DIR", ""}}}, devices, 4, {"POCL_CACHE_DIR is empty"});
  refuse_there({{{"POCL_DEVICES", "none"}}}, devices, 4, {"POCL_DEVICES is 'none'"});
  // A folder that is there and cannot be written fails later, in the compiler.
  fs::create_directories(folder / "locked");
  fs::permissions(folder / "locked", fs::perms::owner_read | fs::perms::owner_exec);
  Surroundings locked{{{"POCL_CACHE_DIR", folder / "locked"}}};
  locked.permissions_count = true;
  const Outcome outcome =
      raysplats_program(training(folder / "run", 1) + Words{"--no-kernel-cache"}, locked);
  INFO(outcome.err);
  CHECK(outcome.code == 4);
  CHECK(contains(outcome.err, folder / "locked"));
  CHECK(contains(outcome.err, "cannot be written"));
}

TEST_CASE("a full disk below the driver's cache is named, and no driver is to be updated") {
  SKIP_TEST_UNLESS(contains(raysplats_program({"devices"}).out, "Portable Computing Language"),
                   "there is no PoCL");
  SKIP_TEST_UNLESS(std::system("unshare --map-root-user --mount mount -t tmpfs none /mnt "
                               "> /dev/null 2>&1") == 0,
                   "no file system may be mounted here");
  const TemporaryFolder folder;
  const std::string disk = folder / "disk";
  fs::create_directories(disk);
  write_file(folder / "model.ply", ply_file(2));
  Surroundings full{{{"XDG_CACHE_HOME", disk}}};
  full.launcher =
      Words{"/usr/bin/env",
            "unshare",
            "--map-root-user",
            "--mount",
            "sh",
            "-c",
            "mount -t tmpfs -o size=1m none \"$0\" && { cat /dev/zero > \"$0/rest\" 2> /dev/null; "
            "exec \"$@\"; }",
            disk};
  const Words render{"render", folder / "model.ply", "--orbit", "1",  "--width",
                     "16",     "--height",           "16",      "-o", folder / "frames"};
  for (const Words& command : {render, Words{"doctor"}}) {
    const Outcome outcome = raysplats_program(command, full);
    INFO(outcome.err);
    CHECK(outcome.code == 4);
    const std::string said = outcome.out + outcome.err;
    CHECK(contains(said,
                   "of its cache cannot be written (No space left on device), name one by "
                   "POCL_CACHE_DIR"));
    CHECK_FALSE(contains(said, "update"));
  }
}

#ifndef __SANITIZE_ADDRESS__  // it takes terabytes of addresses itself
TEST_CASE("too little memory is named") {
  const TemporaryFolder folder;
  const auto refuse_with = [](rlim_t mebibytes, const Words& arguments, const std::string& part) {
    Surroundings little;
    little.memory_limit = mebibytes << 20;
    const Outcome outcome = raysplats_program(arguments, little);
    INFO(outcome.err);
    CHECK(outcome.signal == 0);
    CHECK(outcome.code != 0);
    CHECK(one_sentence(outcome));
    CHECK(contains(outcome.err, part));
    CHECK(contains(outcome.err, std::to_string(mebibytes) + " MiB of memory (ulimit -v)"));
  };
  refuse_with(190, {"devices"}, "OpenCL");
  refuse_with(200, training(folder / "run", 1), "cannot be");
}
#endif
