// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "program.hpp"

TEST_CASE("help and version") {
  const Outcome help = raysplats_program({"--help"});
  CHECK(help.code == 0);
  for (const char* command : {"devices", "generate", "train", "render", "eval", "info", "convert",
                              "view", "bench", "tune", "doctor"}) {
    CHECK(contains(help.out, command));
    const Outcome own = raysplats_program({command, "-h"});
    CHECK(own.code == 0);
    CHECK(contains(own.out, command));
  }
  const Outcome version = raysplats_program({"--version"});
  CHECK(version.code == 0);
  CHECK(version.out == "raysplats " RAYSPLATS_VERSION "\n");
}

TEST_CASE("help of train lists the configuration keys and hides foreign names") {
  const Outcome help = raysplats_program({"train", "--help-all"});
  for (const char* key :
       {"--iterations", "--ssim-weight", "--densify-grad-threshold", "--config", "--resume"}) {
    CHECK(contains(help.out, key));
  }
  for (const char* foreign : {"--max_steps", "--source_path", "--output-dir"}) {
    CHECK_FALSE(contains(help.out, foreign));
  }
}

TEST_CASE("the names of other trainers for data, output and iterations are understood") {
  for (const std::vector<std::string>& names :
       std::vector<std::vector<std::string>>{{"--data_dir", "--result_dir", "--max_steps"},
                                             {"--source_path", "--model_path", "--num-iters"},
                                             {"--data", "--output-dir", "--max-num-iterations"}}) {
    const Outcome result = raysplats_program(
        {"train", names[0], "nowhere/data", names[1], "nowhere/run", names[2], "5"});
    CAPTURE(result.err);
    CHECK(result.code != 0);
    CHECK(contains(result.err, "nowhere/data"));
    CHECK_FALSE(contains(result.err, "option"));
  }
}

TEST_CASE("the names of other trainers are those of train alone") {
  check_refused({"eval", "--model_path", "run"}, 2, "Unknown option --model_path");
  check_refused({"info", "data", "--output-dir", "x"}, 2, "Unknown option --output-dir");
}

TEST_CASE("a wrong command line is one sentence, exit code 2") {
  check_refused({}, 2, "No command given: use one of devices, ");
  CHECK_FALSE(contains(raysplats_program({}).err, "compile-kernels"));
  CHECK_FALSE(contains(raysplats_program({"compile-kernel"}).err, "compile-kernels"));
  check_refused({"rendr"}, 2, "Unknown command rendr: did you mean render?");
  check_refused({"gibberish"}, 2, "Unknown command gibberish: 'raysplats -h' lists all");
  check_refused({"render", "m.ply", "--backgroud", "1,1,1", "-o", "x", "--orbit", "3"}, 2,
                "did you mean --background");
  check_refused({"render", "m.ply", "--loglevel=info", "-o", "x"}, 2, "did you mean --log-level");
  check_refused({"train", "data", "-o", "x", "--ssim-wieght", "0.1"}, 2,
                "did you mean --ssim-weight");
  check_refused({"train", "data", "-o", "x", "--white-background"}, 2,
                "did you mean --background?");
  check_refused({"evaluate"}, 2, "Unknown command evaluate: did you mean eval?");
  check_refused({""}, 2, "Unknown command '': 'raysplats -h' lists all");
  check_refused({"train", "data", "-o", "x", "--epochs", "3"}, 2,
                "Unknown option --epochs: 'raysplats train -h' lists all");
  check_refused({"train", "data", "-o", "x", "--time", "0"}, 2, "no time to train in");
  check_refused({"train", "data", "-o", "x", "--time", "soon"}, 2, "90s, 15m or 1.5h");
  check_refused({"train", "data", "-o", "x", "--time", "9s", "-n", "100"}, 2, "contradict");
  check_refused({"train", "data", "-o", "x", "--time", "9s", "--resume", "x"}, 2, "new runs");
  check_refused({"train", "data", "-o", "x", "--quality", "best"}, 2, "preview, low");
  check_refused({"train", "data", "-o", "x", "--patience", "2"}, 2, "validate-views");
  check_refused({"train", "data", "-o", "x", "--bounds", "1,1,1,0,0,0"}, 2, "greatest x, y and z");
  check_refused({"train", "data", "-o", "x", "--init-count", "9", "--max-gaussians", "5"}, 2,
                "init-count");
  check_refused({"info", "a", "b"}, 2, "Unexpected argument 'b'");
  check_refused({"info"}, 2, "PATH");
  check_refused({"devices", "--json", "--clear-cache"}, 2, "leave out --json");
  check_refused({"render", "m.ply", "--orbit", "0", "-o", "x"}, 2, "--orbit");
  check_refused({"render", "m.ply", "--orbit", "3"}, 2, "--video");
  check_refused({"view", "m.ply", "--up", "0,0,0"}, 2, "The up direction has no length");
  check_refused({"render", "m.ply", "-o", "x", "--path", "p", "--orbit", "3"}, 2, "--path");
  check_refused({"render", "m.ply", "-o", "x", "--spiral", "3"}, 2, "--data");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--seconds", "3"}, 2, "--path");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--fps", "3"}, 2, "--video");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--shutter", "0.5"}, 2,
                "--shutter-samples");
  check_refused({"render", "m.ply", "--orbit", "3", "--video", "x.mp4", "--depth"}, 2, "-o");
  check_refused({"view", "m.ply", "--split", "train"}, 2, "--data DATASET");
  check_refused({"view", "m.ply", "--downscale", "2"}, 2, "--data DATASET");
  check_refused({"view", "scene.toml", "--near", "1"}, 2, "--near is for models");
  check_refused({"render", "m.ply", "-o", "x"}, 2, "no cameras");
  check_refused({"render", "m.ply", "-o", "x", "--data", "d", "--cameras", "c"}, 2, "--cameras");
  check_refused({"render", "m.ply", "-o", "x", "--data", "d", "--fov", "30"}, 2, "--orbit");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--hit-order", "far"}, 2,
                "'hit-order' is entry or peak");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--background", "1,1"}, 2,
                "three numbers");
  check_refused({"render", "m.ply", "-o", "x", "--orbit", "3", "--max-hits", "nan"}, 2,
                "'max-hits' needs a whole number");
}

TEST_CASE("devices can be read by programs") {
  const Outcome outcome = raysplats_program({"devices", "--json"});
  REQUIRE(outcome.code == 0);
  const nlohmann::json json = nlohmann::json::parse(outcome.out);
  REQUIRE(!json.at("devices").empty());
  for (const nlohmann::json& device : json["devices"]) {
    CHECK(device.at("compute_units").get<int>() > 0);
    CHECK(device.at("max_allocation").get<std::uint64_t>() > 0);
    CHECK(device.at("usable").get<bool>() == device.at("problems").empty());
  }
  const Outcome text = raysplats_program({"devices"});
  CHECK(text.code == 0);
  CHECK(contains(text.out, json["devices"][0]["name"].get<std::string>()));
}

TEST_CASE("a list takes no word that is called like a number") {
  const Words train{"train", "-o", "x", "-q"};
  check_refused(train + Words{"--bounds", "-1,-1,-1,1,1,1", "7"}, 3, "7");
  check_refused(train + Words{"--bounds", "-1", "-1", "-1", "1", "1", "1", "7"}, 3, "7");
  check_refused(train + Words{"--save-at", "5", "2024-05-01"}, 3, "2024-05-01");
  check_refused({"render", "--background", "0", "24", "-o", "x", "--orbit", "3"}, 3, "model 24");
  check_refused({"render", "--background", "0", "0", "1", "24", "-o", "x", "--orbit", "3"}, 3,
                "model 24");
  check_refused({"view", "--up", "0,1,0", "24"}, 3, "model 24");
  // What may be either is a number.
  check_refused(train + Words{"--save-at", "5", "7"}, 2,
                "7 is taken for a number of --save-at: write ./7 for a file or folder");
  const Outcome unnamed = raysplats_program({"train", "data", "--save-at", "5", "7"});
  CHECK(contains(unnamed.err, "--output is required"));
  CHECK_FALSE(contains(unnamed.err, "is taken for"));
}

TEST_CASE("without a folder for caches there is none to clear") {
  const Surroundings nowhere{{{"XDG_CACHE_HOME", ""}, {"HOME", ""}}};
  const std::string remedy = "set HOME or XDG_CACHE_HOME";
  check_refusal(raysplats_program({"devices", "--clear-cache"}, nowhere), 3, remedy);
  check_refusal(raysplats_program({"tune", "--reset"}, nowhere), 3, remedy);
}

TEST_CASE("commands that are named can be pasted") {
  const TemporaryFolder folder;
  write_file(folder / "my data/transforms.json", "{}");
  check_refused({"render", folder / "my data", "-o", "x", "--orbit", "3"}, 3,
                "'raysplats train '" + (folder / "my data") + "' -o RUN'");
}

TEST_CASE("the kernel cache is cleared where it lies, and nothing else in it") {
  const TemporaryFolder cache;
  write_file(cache.path() / "raysplats" / "0123.bin", "program");
  write_file(cache.path() / "raysplats" / ".0123.aB3xyZ", "half a program");
  write_file(cache.path() / "raysplats" / ".lock", "");
  write_file(cache.path() / "raysplats" / "notes.txt", "mine");
  const Outcome outcome = raysplats_program({"devices", "--clear-cache"},
                                            {{{"XDG_CACHE_HOME", cache.path().string()}}});
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, "1 compiled"));
  CHECK(entries(cache.path() / "raysplats") == 2);
}

TEST_CASE("no OpenCL platform is exit code 4 with the remedy") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  const Surroundings bare{{{"OCL_ICD_VENDORS", folder.path().string()}}};
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{"devices"},
        {"-q", "render", folder / "model.ply", "--orbit", "1", "-o", folder / "frames"}}) {
    check_refusal(raysplats_program(arguments, bare), 4, "pocl-opencl-icd");
  }
  CHECK(entries(folder / "frames") == 0);
}

TEST_CASE("the compiling of kernels is a bar on a terminal, lines elsewhere, and counted apart") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  const std::vector<std::string> render{
      "render", folder / "model.ply", "--orbit",          "1", "--width", "8",
      "-o",     folder / "x",         "--no-kernel-cache"};
  const Outcome lines = raysplats_program(render);
  REQUIRE(lines.code == 0);
  CHECK(lines.err.find("\ncompiling kernels [") != std::string::npos);
  CHECK(lines.err.find("] 1, ") != std::string::npos);
  CHECK(lines.err.find('\r') == std::string::npos);
  CHECK(lines.out.find(" s of compiling kernels") != std::string::npos);
  Surroundings terminal;
  terminal.terminal = true;
  const Outcome bar = raysplats_program(render, terminal);
  REQUIRE(bar.code == 0);
  CHECK(bar.err.find("\r\x1b[Kcompiling kernels [") != std::string::npos);
  CHECK(bar.err.find("] 1, ") != std::string::npos);
  std::vector<std::string> quiet = render;
  quiet.emplace_back("-q");
  CHECK(raysplats_program(quiet).err.empty());
}

TEST_CASE("an unknown device is exit code 2") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  for (const char* device : {"99", "no such device"}) {
    check_refused({"render", folder / "model.ply", "--orbit", "1", "-o", folder / "frames",
                   "--device", device, "-q"},
                  2, "raysplats devices");
  }
}
