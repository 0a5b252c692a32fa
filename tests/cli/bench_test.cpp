// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "../skip_test.hpp"
#include "build_paths.hpp"
#include "program.hpp"

namespace {

const std::vector<std::string> kTiny{"bench",          "--sizes",     "1k",   "--resolution",
                                     "32x32",          "--repeat",    "2",    "--filter",
                                     "adam/|forward/", "--log-level", "error"};

std::vector<std::string> with(std::vector<std::string> arguments,
                              const std::vector<std::string>& more) {
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

}  // namespace

TEST_CASE("bench lists its rows without running") {
  const Outcome outcome =
      raysplats_program({"bench", "--list", "--sizes", "1k,1.5M", "--scene", "random,surface"});
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, "backward/random/1000\n"));
  CHECK(contains(outcome.out, "refit/surface/1500000\n"));
  const Outcome large = raysplats_program({"bench", "--list", "--large", "--filter", "^sort/"});
  CHECK(large.out ==
        "sort/random/10000\nsort/random/100000\nsort/random/1000000\nsort/random/3000000\n");
}

TEST_CASE("bench writes JSON and CSV that compare reads") {
  const TemporaryFolder folder;
  write_file(folder / "a.json", "of before");
  const Outcome first =
      raysplats_program(with(kTiny, {"--json", folder / "a.json", "--csv", folder / "a.csv",
                                     "--packet-width", "4", "--overwrite"}));
  INFO(first.err);
  REQUIRE(first.code == 0);
  CHECK(contains(first.out, "forward/random/1000"));
  CHECK(contains(first.out, "adam/random/1000"));
  CHECK_FALSE(contains(first.out, "refit"));
  const nlohmann::json json = nlohmann::json::parse(read_file(folder / "a.json"));
  CHECK(json.at("schema") == "raysplats-bench");
  CHECK(json.at("options").at("packet-width") == "4");
  CHECK(json.at("options").at("resolution") == "32x32");
  REQUIRE(json.at("rows").size() == 2);
  CHECK(json["rows"][0].at("seconds").at("median").get<double>() > 0);
  CHECK(json.at("ceilings").at("fma_flops_per_second").get<double>() > 0);
  CHECK(contains(read_file(folder / "a.csv"), "\nforward,"));

  const Outcome same =
      raysplats_program({"bench", "compare", folder / "a.json", folder / "a.json"});
  CHECK(same.code == 0);
  CHECK(contains(same.out, "1.000"));
  CHECK_FALSE(contains(same.out, "1.000 *"));
  write_file(folder / "none.json", "{}");
  check_refused({"bench", "compare", folder / "a.json", folder / "none.json"}, 3, "no result");
  check_refused({"bench", "compare", folder / "a.json", folder / "missing.json"}, 3, "missing");
  check_refused({"bench", "compare", folder / "a.json"}, 2, "B is required");
}

TEST_CASE("what bench has measured is in its files though nobody can read the table") {
  Surroundings full;
  full.out_file = "/dev/full";
  SKIP_TEST_UNLESS(std::filesystem::exists(full.out_file), "there is no /dev/full");
  const TemporaryFolder folder;
  // So many rows that the table is written before the end of the program.
  constexpr int kRows = 50;
  std::string sizes = "100";
  for (int i = 1; i < kRows; ++i) sizes += "," + std::to_string(100 + i);
  check_refusal(raysplats_program({"bench", "--sizes", sizes, "--repeat", "1", "--filter", "adam/",
                                   "-q", "--json", folder / "a.json", "--csv", folder / "a.csv",
                                   "--html", folder / "a.html"},
                                  full),
                3, "Standard output cannot be written: ");
  REQUIRE(entries(folder.path()) == 3);
  CHECK(nlohmann::json::parse(read_file(folder / "a.json")).at("rows").size() == kRows);
}

TEST_CASE("bench measures a model seen by a camera") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(20));
  write_file(folder / "cameras.json",
             R"({"w":40,"h":30,"fl_x":40,"fl_y":40,"cx":20,"cy":15,"frames":[
               {"file_path":"a.png","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,6],[0,0,0,1]]},
               {"file_path":"b.png","transform_matrix":[[1,0,0,0],[0,1,0,0],[0,0,1,7],[0,0,0,1]]}]})");
  // The default budget follows from the memory that is free when a program begins.
  const std::vector<std::string> model{
      "bench",    "--model", folder / "balls.ply", "--cameras", folder / "cameras.json",
      "--repeat", "1",       "--filter",           "view",      "--memory-budget",
      "256",      "-q"};
  const Outcome outcome = raysplats_program(with(model, {"--json", folder / "m.json"}));
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "prepare-view/balls/20"));
  const nlohmann::json json = nlohmann::json::parse(read_file(folder / "m.json"));
  CHECK(json.at("options").at("resolution") == "40x30");
  check_refused(with(model, {"--view", "2"}), 2, "--view 2 is beyond");

  // What else is measured than before is said.
  REQUIRE(raysplats_program(with(model, {"--view", "1", "--near", "0.5", "--launch-budget-ms", "50",
                                         "--json", folder / "n.json"}))
              .code == 0);
  const Outcome compared =
      raysplats_program({"bench", "compare", folder / "m.json", folder / "n.json"});
  CHECK(contains(compared.out,
                 "--launch-budget-ms: -1 -> 50\n--near: 0 -> 0.5\n--view: a.png -> b.png\n"));
}

TEST_CASE("bench writes one file for the owner of a device to send") {
  const TemporaryFolder folder;
  const std::vector<std::string> report{"bench",    "--report",     folder / "report.json",
                                        "--sizes",  "1k",           "--resolution",
                                        "32x32",    "--repeat",     "1",
                                        "--filter", "^(adam|view)", "-q"};
  const Outcome outcome = raysplats_program(report);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "self-test passed"));
  CHECK(contains(outcome.out, "1600x1064"));
  const nlohmann::json json = nlohmann::json::parse(read_file(folder / "report.json"));
  CHECK(json.at("self_test_passed") == true);
  CHECK(json.at("frames").size() == 2);
  CHECK(json.at("device").contains("driver_version"));
  check_refused(with(report, {"--json", folder / "a.json"}), 2, "--json does not go with --report");
  check_refused(with(report, {"--kernels", "a", "--against", "b"}), 2, "leave out --kernels");
  check_refused({"bench", "--kernels", "cl"}, 2, "give both");
  write_file(folder / "file", "no folder");
  check_refused({"bench", "--report", folder / "file/report.json", "-q"}, 3, "file");
}

TEST_CASE("the file for the owner of a device to send is written whatever fails") {
  for (const int n : {1, 250}) {
    CAPTURE(n);
    const TemporaryFolder folder;
    const Outcome outcome = raysplats_program(
        {"bench", "--report", folder / "report.json", "--sizes", "300", "--resolution", "64x48",
         "--repeat", "1", "--filter", "^(sort|adam)/", "-q"},
        {{{"RAYSPLATS_FAIL_LAUNCH", std::to_string(n)}}});
    INFO(outcome.err);
    const nlohmann::json json = nlohmann::json::parse(read_file(folder / "report.json"));
    const bool passed = json.at("self_test_passed").get<bool>();
    const auto failed = json.at("failed").get<std::size_t>();
    CHECK((n > 1 || !passed));
    CHECK(outcome.code == (passed && failed == 0 ? 0 : 4));
    // Which launch that is depends on the device; on most it is one of a row.
    if (failed > 0) {
      CHECK(contains(outcome.err, "fails in 1 part of what is measured, named under left_out"));
      CHECK(contains(json.at("left_out").at(0).get<std::string>(), "Launching kernel"));
    }
    CHECK(json.at("runs").size() == 2);
  }
}

TEST_CASE("bench tells what it measured whatever fails") {
  const TemporaryFolder folder;
  const Outcome outcome =
      raysplats_program({"bench", "--sizes", "300", "--resolution", "64x48", "--repeat", "1",
                         "--filter", "^(sort|adam)/", "--json", folder / "rows.json", "-q"},
                        {{{"RAYSPLATS_FAIL_LAUNCH", "1"}}});
  INFO(outcome.err);
  CHECK(outcome.code == 4);
  CHECK(contains(outcome.err, "fails in 1 part of what is measured, named as left out"));
  CHECK(contains(outcome.out, "left out: the device's limits: "));
  CHECK(nlohmann::json::parse(read_file(folder / "rows.json")).at("rows").size() == 2);
}

TEST_CASE("bench compares two folders of kernels") {
  const TemporaryFolder folder;
  const std::string kernels = raysplats::test::source_dir() + "/cl";
  const std::vector<std::string> both{"bench", "--kernels", kernels, "--against", kernels};
  const Outcome outcome =
      raysplats_program(with(both, {"--sizes", "1k", "--resolution", "32x32", "--repeat", "2",
                                    "--filter", "^adam", "-q"}));
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "equal to the last bit"));
  CHECK(contains(outcome.out, "adam/random/1000"));
  check_refused(
      {"bench", "--kernels", kernels, "--against", folder / "none", "--sizes", "1k", "-q"}, 4,
      "cannot be read");
}

TEST_CASE("bench refuses what it cannot measure") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  check_refused({"bench", "--sizes", "many"}, 2, "--sizes 'many'");
  check_refused({"bench", "--sizes", "0"}, 2, "--sizes '0'");
  check_refused({"bench", "--scene", "moon"}, 2, "--scene 'moon'");
  check_refused({"bench", "--resolution", "800"}, 2, "--resolution '800'");
  check_refused({"bench", "--resolution", "0x3"}, 2, "--resolution '0x3'");
  check_refused({"bench", "--filter", "("}, 2, "no regular expression");
  check_refused({"bench", "--filter", "nothing", "-q"}, 2, "leaves no row");
  check_refused({"bench", "--cameras", "x.json"}, 2, "--model");
  check_refused({"bench", "--model", folder / "balls.ply"}, 2, "--cameras");
  check_refused({"bench", "--model", folder / "none.ply", "--cameras", "x"}, 3, "none.ply");
  check_refused({"bench", "--repeat", "0"}, 2, "--repeat");
  check_refused({"tune", "--axes", "colour"}, 2, "--axes 'colour'");
}

TEST_CASE("tune stores its result, devices shows it, and reset forgets it") {
  const TemporaryFolder cache;
  const Surroundings there{{{"XDG_CACHE_HOME", cache.path().string()}}};
  const std::vector<std::string> tune{"tune",     "--size", "100",    "--resolution", "16x16",
                                      "--repeat", "1",      "--axes", "group",        "-q"};
  const std::string file = (cache.path() / "raysplats" / "tuning.json").string();
  Outcome outcome = raysplats_program(with(tune, {"--dry-run"}), there);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.out, "best:"));
  CHECK_FALSE(std::filesystem::exists(file));
  CHECK(contains(raysplats_program({"devices"}, there).out, "tuning          none"));

  outcome = raysplats_program(tune, there);
  REQUIRE(outcome.code == 0);
  const nlohmann::json stored = nlohmann::json::parse(read_file(file));
  REQUIRE(stored.at("devices").size() == 1);
  const nlohmann::json& entry = stored["devices"][0];
  CHECK(entry.at("raysplats") == RAYSPLATS_VERSION);
  const int width = entry.at("packet_width").get<int>();
  CHECK(
      contains(raysplats_program({"devices"}, there).out, "packet width " + std::to_string(width)));
  const nlohmann::json devices =
      nlohmann::json::parse(raysplats_program({"devices", "--json"}, there).out);
  CHECK(devices.at("devices")[0].at("tuning").at("packet_width") == width);

  outcome = raysplats_program({"tune", "--reset"}, there);
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, "1 tuning"));
  CHECK(contains(raysplats_program({"devices"}, there).out, "tuning          none"));

  write_file(file, "{ broken");
  outcome = raysplats_program({"devices"}, there);
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, "tuning          none"));
  CHECK(contains(outcome.err, "is ignored"));
}
