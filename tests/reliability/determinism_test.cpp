// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <string>

#include "tiny_run.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;

TEST_CASE(
    "two runs with one seed leave the same bytes, and so do an interrupted and a resumed one") {
  const TemporaryFolder folder;
  // At the same time, so that they disturb each other's scheduling.
  RunningProgram first(tiny_training(folder / "a"));
  RunningProgram second(tiny_training(folder / "b"));
  REQUIRE(first.wait().code == 0);
  REQUIRE(second.wait().code == 0);
  CHECK(same_result(folder / "a", undisturbed()));
  CHECK(same_result(folder / "b", undisturbed()));

  const Words half = tiny_training(folder / "c");
  REQUIRE(raysplats_program(half).code == 0);
  REQUIRE(std::filesystem::remove(checkpoint_of(folder / "c", kIterations)));
  REQUIRE(std::filesystem::remove(model_of(folder / "c")));
  REQUIRE(std::filesystem::exists(checkpoint_of(folder / "c", kIterations - 5)));
  REQUIRE(raysplats_program(half + Words{"--resume", "latest"}).code == 0);
  CHECK(same_result(folder / "c", undisturbed()));

  const Words other = tiny_training(folder / "d") + Words{"--seed", "43"};
  REQUIRE(raysplats_program(other).code == 0);
  CHECK(read_file(model_of(folder / "d")) != read_file(model_of(undisturbed())));
}

TEST_CASE(
    "exact sums make a run independent of the number of threads, of packets' bands and of load") {
  const TemporaryFolder folder;
  const Words exact{"--gradient-sum", "exact"};
  const auto run = [&](const std::string& name, const Words& more, const Surroundings& around) {
    const Outcome outcome = raysplats_program(tiny_training(folder / name) + exact + more, around);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return read_file(model_of(folder / name));
  };
  const std::string model = run("plain", {}, {});
  CHECK(run("three", {}, {{{"POCL_MAX_PTHREAD_COUNT", "3"}}}) == model);
  CHECK(run("bands", {"--launch-budget-ms", "0.001"}, {}) == model);
}

TEST_CASE("runs whose rays are traced one by one, through a mirror, leave the same bytes as well") {
  const TemporaryFolder folder;
  write_text_file(folder / "mirror.obj",
                  "v -4 -4 -1.2\nv 4 -4 -1.2\nv 4 4 -1.2\nv -4 4 -1.2\nf 1 2 3\nf 1 3 4\n");
  const auto run = [&](const std::string& name, const Words& more, const Surroundings& around) {
    const Words mirror{"--mirror", folder / "mirror.obj"};
    const Outcome outcome = raysplats_program(tiny_training(folder / name) + mirror + more, around);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return read_file(model_of(folder / name));
  };
  const std::string copies = run("copies", {}, {});
  CHECK(copies != read_file(model_of(undisturbed())));
  // A resumed run builds the tree over the Gaussians anew where the other one refitted it.
  REQUIRE(std::filesystem::remove(checkpoint_of(folder / "copies", kIterations)));
  CHECK(run("copies", {"--resume", "latest"}, {}) == copies);

  const Words exact{"--gradient-sum", "exact"};
  const std::string model = run("exact", exact, {});
  CHECK(run("three", exact, {{{"POCL_MAX_PTHREAD_COUNT", "3"}}}) == model);
}
