// SPDX-License-Identifier: Apache-2.0
// What a run that is resumed knows of itself.
#include <filesystem>
#include <string>

#include "raysplats/error.hpp"
#include "tiny_run.hpp"

namespace fs = std::filesystem;

namespace {

// Goes on by a command line that names no option of the run.
Outcome go_on(const std::string& run, const std::string& source, const Words& more = {}) {
  return raysplats_program(Words{"train", tiny_data(), "-o", run, "--resume", source, "-q"} + more);
}

}  // namespace

TEST_CASE("a resumed run has its options, wherever they are written") {
  const TemporaryFolder folder;
  const std::string model = read_file(model_of(undisturbed()));
  const auto check = [&](const std::string& run, const Outcome& outcome) {
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(read_file(model_of(run)) == model);
  };
  // A file of a few keys changes these alone.
  const std::string filed = folder / "filed";
  broken_off(filed);
  write_file(folder / "rows.toml", "log-every = 20\n");
  check(filed, go_on(filed, "latest", {"--config", folder / "rows.toml"}));
  CHECK(contains(read_file(filed + "/config.toml"), "log-every = 20\n"));
  CHECK(contains(read_file(filed + "/config.toml"), "max-gaussians = 600\n"));

  const std::string bare = folder / "bare";
  broken_off(bare);
  fs::remove(bare + "/config.toml");
  check(bare, go_on(bare, "latest"));

  const std::string kept = folder / "kept.rsck";
  fs::copy_file(checkpoint_of(undisturbed(), 25), kept);
  check(folder / "other", go_on(folder / "other", kept));
}

TEST_CASE("a run whose evaluation cannot be written goes on later as if nothing had been") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  // After the sixteenth iteration density control is due.
  const Words words = tiny_training(run) + Words{"--eval-at", "16"};
  write_file(run + "/eval/iteration_16", "in the way");
  const Outcome outcome = raysplats_program(words);
  INFO(outcome.err);
  CHECK(outcome.code == 3);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "iteration 16 is saved"));
  fs::remove(run + "/eval/iteration_16");
  REQUIRE(go_on(run, "latest").code == 0);
  CHECK(read_file(model_of(run)) == read_file(model_of(undisturbed())));
  CHECK(fs::exists(run + "/eval/iteration_16/metrics.json"));
}
