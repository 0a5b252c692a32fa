// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <cstring>
#include <filesystem>
#include <string>

#include "raysplats/error.hpp"
#include "run/checkpoint.hpp"
#include "tiny_run.hpp"

namespace fs = std::filesystem;

TEST_CASE("a damaged checkpoint is passed over with a warning, and the result is the same") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const Words keep{"--keep-checkpoints", "3"};
  REQUIRE(raysplats_program(tiny_training(run) + keep).code == 0);
  fs::remove_all(fs::path(run) / "point_cloud");
  const std::string newest = read_file(checkpoint_of(run, 30));
  write_file(checkpoint_of(run, 30), newest.substr(0, newest.size() / 2));
  std::string flipped = read_file(checkpoint_of(run, 25));
  flipped[flipped.size() - 1000] = static_cast<char>(flipped[flipped.size() - 1000] ^ 16);
  write_file(checkpoint_of(run, 25), flipped);
  write_file(fs::path(run) / "checkpoints" / ".step_000000030.999999.tmp.rsck", "half");

  Words arguments = tiny_training(run) + keep + Words{"--resume", "latest", "--log-level", "warn"};
  std::erase(arguments, "-q");
  const Outcome outcome = raysplats_program(arguments);
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  CHECK(contains(outcome.err, "step_000000030.rsck is truncated"));
  CHECK(contains(outcome.err, "step_000000025.rsck is damaged"));
  CHECK(temporaries(run) == 0);
  CHECK(read_file(model_of(run)) == read_file(model_of(undisturbed())));

  // When none is left whole, the run is not silently started anew.
  for (const auto& path : raysplats::list_checkpoints(run)) write_file(path, "RSCKPT\r\n");
  const Outcome refused = raysplats_program(tiny_training(run) + Words{"--resume", "latest"});
  INFO(refused.err);
  CHECK(refused.code == 3);
  CHECK(one_sentence(refused));
}

TEST_CASE("other data, a newer file and a folder without checkpoints") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  broken_off(run);
  const std::string data = folder / "data";
  REQUIRE(raysplats_program({"generate", data, "--size", "32", "--train-views", "6", "--test-views",
                             "1", "--seed", "7", "-q"})
              .code == 0);
  Words arguments = tiny_training(run) + Words{"--resume", "latest"};
  arguments[1] = data;
  const Outcome other = raysplats_program(arguments);
  INFO(other.err);
  CHECK(other.code == 2);
  CHECK(one_sentence(other));
  CHECK(contains(other.err, "other data"));

  std::string newer = read_file(checkpoint_of(run, 25));
  newer[8] = 3;
  write_file(folder / "newer.rsck", newer);
  const Outcome refused =
      raysplats_program(tiny_training(folder / "new") + Words{"--resume", folder / "newer.rsck"});
  INFO(refused.err);
  CHECK(refused.code == 3);
  CHECK(one_sentence(refused));
  CHECK(contains(refused.err, "version 3"));

  // 'latest' of an empty folder is a start, so that one command line serves first and later tries.
  const Outcome fresh =
      raysplats_program(tiny_training(folder / "fresh") + Words{"--resume", "latest"});
  INFO(fresh.err);
  CHECK(fresh.code == 0);
  CHECK(same_result(folder / "fresh", undisturbed()));
  CHECK(
      raysplats_program(tiny_training(folder / "none") + Words{"--resume", folder / "none"}).code ==
      3);
}

TEST_CASE("a full disk ends the run with exit code 3 and whole files, and the run goes on later") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  undisturbed();  // so that a driver that keeps kernels by their launches has all of them
  Surroundings full;
  full.file_size_limit = 16384;
  full.full_once = [&] { return fs::exists(checkpoint_of(run, 20)); };
  const Words arguments = tiny_training(run) + Words{"--resume", "latest"};
  const Outcome outcome = raysplats_program(arguments, full);
  INFO(outcome.err);
  CHECK(outcome.code == 3);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "File too large"));
  CHECK(temporaries(run) == 0);
  CHECK(!fs::exists(model_of(run)));
  REQUIRE(raysplats_program(arguments).code == 0);
  CHECK(same_result(run, undisturbed()));
}

TEST_CASE("a read-only folder ends the run with exit code 3 and changes nothing") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  broken_off(run);
  const std::string before = read_file(checkpoint_of(run, 25));
  Surroundings strict;
  strict.permissions_count = true;
  const Words arguments = tiny_training(run) + Words{"--resume", "latest"};
  for (const std::string& closed : {run + "/checkpoints", run}) {
    CAPTURE(closed);
    REQUIRE(::chmod(closed.c_str(), 0555) == 0);
    const Outcome outcome = raysplats_program(arguments, strict);
    REQUIRE(::chmod(closed.c_str(), 0755) == 0);
    INFO(outcome.err);
    CHECK(outcome.code == 3);
    CHECK(one_sentence(outcome));
    CHECK(contains(outcome.err, run));
    CHECK(temporaries(run) == 0);
    CHECK(read_file(checkpoint_of(run, 25)) == before);
  }
  REQUIRE(raysplats_program(arguments).code == 0);
  CHECK(same_result(run, undisturbed()));
}
