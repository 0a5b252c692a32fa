// SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <filesystem>
#include <string>

#include "raysplats/error.hpp"
#include "run/checkpoint.hpp"
#include "tiny_run.hpp"

namespace {

// The run with the n-th call failing, then the same run resumed without.
void check_fault(const std::string& variable, int n, int code) {
  CAPTURE(variable);
  CAPTURE(n);
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const Outcome outcome = raysplats_program(tiny_training(run), {{{variable, std::to_string(n)}}});
  INFO(outcome.err);
  REQUIRE(outcome.code == code);
  CHECK(one_sentence(outcome));
  CHECK(temporaries(folder.path()) == 0);
  for (const auto& path : raysplats::list_checkpoints(run))
    CHECK_NOTHROW(raysplats::read_checkpoint(path));
  if (contains(outcome.err, "is saved")) {
    const std::int64_t newest = raysplats::load_latest_checkpoint(run).iteration;
    CHECK(contains(outcome.err, "iteration " + std::to_string(newest) + " is saved"));
  }
  if (n == 1) return;  // nothing had begun
  const Outcome resumed = raysplats_program(tiny_training(run) + Words{"--resume", "latest"});
  INFO(resumed.err);
  REQUIRE(resumed.code == 0);
  CHECK(same_result(run, undisturbed()));
}

}  // namespace

TEST_CASE("a failed allocation is exit code 5, and the run goes on where it was") {
  for (const int n : {1, 90}) check_fault("RAYSPLATS_FAIL_ALLOC", n, 5);
}

TEST_CASE("a failed build is exit code 4, and the run goes on where it was") {
  for (const int n : {1, 12}) check_fault("RAYSPLATS_FAIL_BUILD", n, 4);
}

TEST_CASE("a failed launch is exit code 4, and the run goes on where it was") {
  for (const int n : {150, 402, 403}) check_fault("RAYSPLATS_FAIL_LAUNCH", n, 4);
}

TEST_CASE("a view without room costs a step and changes no byte of the result") {
  for (const char* variable : {"RAYSPLATS_FAIL_LISTS", "RAYSPLATS_FAIL_HITS"}) {
    for (const int n : {2, 13, 24}) {  // of the 29 views that are not waited for
      CAPTURE(variable);
      CAPTURE(n);
      const TemporaryFolder folder;
      const std::string run = folder / "run";
      const Outcome outcome =
          raysplats_program(tiny_training(run), {{{variable, std::to_string(n)}}});
      INFO(outcome.err);
      REQUIRE(outcome.code == 0);
      CHECK(same_result(run, undisturbed()));
    }
  }
}

TEST_CASE("rays that the cap on hits stops in a step that fails count once") {
  const Words capped{"--max-hits", "3"};
  const TemporaryFolder folder;
  const std::string whole = folder / "whole";
  REQUIRE(raysplats_program(tiny_training(whole) + capped).code == 0);
  REQUIRE(raysplats::read_checkpoint(checkpoint_of(whole, kIterations)).capped_rays > 100);
  for (const int n : {400, 405, 410, 415, 420}) {  // a step has some 25 launches
    CAPTURE(n);
    const std::string run = folder / ("run" + std::to_string(n));
    const Outcome failed = raysplats_program(tiny_training(run) + capped,
                                             {{{"RAYSPLATS_FAIL_LAUNCH", std::to_string(n)}}});
    REQUIRE(failed.code == 4);
    REQUIRE(raysplats_program(tiny_training(run) + capped + Words{"--resume", "latest"}).code == 0);
    CHECK(same_result(run, whole));
  }
}

TEST_CASE("a loss that stays infinite stops the run with a dump and the model as it was") {
  const TemporaryFolder folder;
  const std::string start = folder / "start.ply";
  std::string model = ply_file(1);
  const float huge = 1e30f;
  for (std::size_t color = 0; color < 3; ++color)
    std::memcpy(model.data() + model.size() - 56 + 4 * (3 + color), &huge, sizeof(huge));
  write_file(start, model);
  const std::string run = folder / "run";
  const Words poisoned{"--init",          start, "--pixel-loss", "l2", "--sh-degree", "0",
                       "--densify-until", "0",   "--log-every",  "7"};
  const Outcome outcome = raysplats_program(tiny_training(run) + poisoned);
  INFO(outcome.err);
  CHECK(outcome.code == 1);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "10 steps in a row by iteration 14"));
  const std::filesystem::path dump = std::filesystem::path(run) / "dump";
  for (const char* name : {"state.rsck", "picture.exr", "step.json"})
    CHECK(std::filesystem::exists(dump / name));
  const raysplats::Checkpoint state = raysplats::read_checkpoint(dump / "state.rsck");
  CHECK(state.bad_steps == 10);
  CHECK(state.sections.at("sh") == std::vector<float>{huge, huge, huge});
  for (const float moment : state.sections.at("sh.first")) CHECK(moment == 0.0f);
}
