// SPDX-License-Identifier: Apache-2.0
// Training that several ranks share: the bytes of one rank, and what happens when one ends.
#include <doctest/doctest.h>
#include <sys/types.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>

#include "../skip_test.hpp"
#include "build_paths.hpp"
#include "ranks.hpp"
#include "run/checkpoint.hpp"
#include "tiny_run.hpp"

namespace {

using namespace std::chrono_literals;

Words shared_training(const std::string& run, int views = 4) {
  return tiny_training(run) + Words{"--views-per-step", std::to_string(views)};
}

// What is the same of two runs beside their results: all but clocks.
std::string losses_of(const std::string& run) {
  std::istringstream rows(read_file(run + "/metrics.csv"));
  std::string out;
  for (std::string row; std::getline(rows, row);) {
    std::istringstream columns(row);
    std::string column;
    for (int i = 0; std::getline(columns, column, ','); ++i) {
      if (i != 1 && i != 5) out += column + ",";  // seconds, it_per_s
    }
    out += "\n";
  }
  return out;
}

bool same_run(const std::string& a, const std::string& b) {
  const std::string losses = losses_of(a);
  const auto measures = [](const std::string& run) {
    return read_file(run + "/eval/iteration_30/metrics.json");
  };
  return same_result(a, b) && contains(losses, "30,") && losses == losses_of(b) &&
         !measures(a).empty() && measures(a) == measures(b) && entries(a) == entries(b);
}

// The process of a rank that mpirun has started; 0 while it is not there.
pid_t process_of(pid_t launcher, int rank) {
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != name.npos) continue;
    std::ifstream status(entry.path() / "stat");
    std::string text;
    std::getline(status, text);
    std::istringstream rest(text.substr(std::min(text.rfind(')') + 2, text.size())));
    char state = 0;
    pid_t parent = 0;
    rest >> state >> parent;
    if (parent != launcher) continue;
    std::ifstream environment(entry.path() / "environ");
    const std::string wanted = "OMPI_COMM_WORLD_RANK=" + std::to_string(rank);
    for (std::string variable; std::getline(environment, variable, '\0');) {
      if (variable == wanted) return std::stoi(name);
    }
  }
  return 0;
}

void wait_for_checkpoint(RunningProgram& program, const std::string& run) {
  for (int i = 0; i < 6000 && raysplats::list_checkpoints(run).empty(); ++i) {
    REQUIRE(program.runs());
    std::this_thread::sleep_for(10ms);
  }
}

}  // namespace

TEST_CASE("devices of a list train the model of one") {
  const TemporaryFolder folder;
  // Five views: shares of two and three, in the middle of the tree. Six: shares of three, of which
  // one is told in pairs and one.
  for (const int views : {4, 5, 6}) {
    CAPTURE(views);
    const std::string name = std::to_string(views);
    const Outcome one = raysplats_program(shared_training(folder / (name + " one"), views));
    INFO(one.err);
    REQUIRE(one.code == 0);
    for (const std::string devices : {"0,0", "0,0,0"}) {
      CAPTURE(devices);
      const std::string run = folder / (name + " of " + devices);
      const Outcome shared =
          raysplats_program(shared_training(run, views) + Words{"--device", devices, "--profile"});
      INFO(shared.err);
      REQUIRE(shared.code == 0);
      CHECK(same_run(run, folder / (name + " one")));
      CHECK(contains(shared.out, "for each step: "));
      CHECK(contains(shared.out, "ms beside other work"));
    }
  }
}

TEST_CASE("what photos have of their own is shared too") {
  const TemporaryFolder folder;
  REQUIRE(raysplats_program({"generate", folder / "outdoor", "--scene", "outdoor", "--size", "32",
                             "--train-views", "6", "--test-views", "1", "-q"})
              .code == 0);
  struct Kind {
    std::string name, data;
    Words words;
  };
  for (const auto& [name, data, words] :
       {Kind{"exposure and a sky, MCMC",
             folder / "outdoor",
             {"--exposure", "--background", "sky", "--strategy", "mcmc"}},
        Kind{"poses, sparse steps, validation",
             tiny_data(),
             {"--poses", "--sparse-adam", "--validate-views", "2"}},
        Kind{"the classic rules",
             tiny_data(),
             {"--strategy", "adc", "--opacity-reset-every", "10"}}}) {
    const std::string kind = name;
    CAPTURE(kind);
    const auto train = [&, data = data, words = words](const std::string& run, const Words& more) {
      Words training = shared_training(run, 3) + words + more;
      training[1] = data;
      const Outcome outcome = raysplats_program(training);
      INFO(outcome.err);
      REQUIRE(outcome.code == 0);
    };
    train(folder / (name + " 1"), {});
    train(folder / (name + " 2"), {"--device", "0,0"});
    CHECK(same_run(folder / (name + " 1"), folder / (name + " 2")));
  }
}

TEST_CASE("the parts of a processor train as one of them does") {
  const TemporaryFolder folder;
  const Surroundings halves{.environment = {{"RAYSPLATS_CPU_PARTS", "2"}}};
  const Outcome devices = raysplats_program({"devices"}, halves);
  SKIP_TEST_UNLESS(devices.code == 0 || !contains(devices.err, "compute units, give a number"),
                   "one core alone cannot be divided");
  INFO(devices.err);
  REQUIRE(devices.code == 0);
  const auto train = [&](const std::string& name, const std::string& list) {
    const Outcome outcome =
        raysplats_program(shared_training(folder / name) + Words{"--device", list}, halves);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return folder / name;
  };
  const std::string one = train("one", "1");
  CHECK(same_run(train("two", "0,1"), one));
  const Outcome no =
      raysplats_program({"devices"}, {.environment = {{"RAYSPLATS_CPU_PARTS", "0"}}});
  CHECK(no.code == 2);
  CHECK(one_sentence(no));
}

TEST_CASE("ranks without a view are refused") {
  const TemporaryFolder folder;
  const Outcome outcome =
      raysplats_program(tiny_training(folder / "run") + Words{"--device", "0,0"});
  CHECK(outcome.code == 2);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "'views-per-step' = 1 leaves some without one"));
  CHECK_FALSE(std::filesystem::exists(checkpoint_of(folder / "run", 5)));
}

MPI_TEST_CASE("processes of mpirun train the model of one, and go on from each other's files") {
  const TemporaryFolder folder;
  REQUIRE(raysplats_program(shared_training(folder / "1")).code == 0);
  for (const int ranks : {2, 4}) {
    CAPTURE(ranks);
    const std::string run = folder / std::to_string(ranks);
    const Outcome shared = raysplats_program(shared_training(run), mpirun(ranks));
    INFO(shared.err);
    REQUIRE(shared.code == 0);
    CHECK(same_run(run, folder / "1"));
    // Back to the last checkpoint but one, and on with another number of ranks.
    REQUIRE(std::filesystem::remove(checkpoint_of(run, kIterations)));
    REQUIRE(std::filesystem::remove(model_of(run)));
    const Outcome resumed =
        raysplats_program(shared_training(run) + Words{"--resume", "latest"}, mpirun(6 - ranks));
    INFO(resumed.err);
    REQUIRE(resumed.code == 0);
    CHECK(same_result(run, folder / "1"));
  }
}

MPI_TEST_CASE("the time of a run is the same for all processes") {
  const TemporaryFolder folder;
  const Outcome outcome =
      raysplats_program({"train", tiny_data(), "-o", folder / "run", "--time", "6s",
                         "--max-gaussians", "400", "--views-per-step", "2", "-q"},
                        mpirun(2));
  INFO(outcome.err);
  CHECK(outcome.code == 0);
  CHECK(contains(outcome.out, "iterations in"));
}

MPI_TEST_CASE("processes with other options or data than the first do not train") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  const Words other{":", "-n", "1", raysplats::test::program_file()};
  const Outcome outcome = raysplats_program(
      shared_training(run) + other + shared_training(run) + Words{"--seed", "43"}, mpirun(1));
  INFO(outcome.err);
  CHECK(outcome.code == 1);
  CHECK(sentences(outcome.err) == 1);
  CHECK(contains(outcome.err, "rank 1 has another model than rank 0"));
}

MPI_TEST_CASE("a signal to mpirun saves the run and ends all processes") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  RunningProgram program(shared_training(run) + Words{"-n", "100000000"}, mpirun(2));
  wait_for_checkpoint(program, run);
  REQUIRE(::kill(program.process(), SIGINT) == 0);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.code != 0);
  const std::int64_t reached = raysplats::load_latest_checkpoint(run).iteration;
  CHECK(temporaries(run) == 0);
  const Outcome resumed = raysplats_program(
      shared_training(run) + Words{"--resume", "latest", "-n", std::to_string(reached + 5)});
  INFO(resumed.err);
  CHECK(resumed.code == 0);
}

MPI_TEST_CASE("when a process is killed the others end within seconds, and whole files stay") {
  for (const int killed : {0, 2}) {
    CAPTURE(killed);
    const TemporaryFolder folder;
    const std::string run = folder / "run";
    RunningProgram program(shared_training(run) + Words{"-n", "100000000"}, mpirun(3));
    wait_for_checkpoint(program, run);
    const pid_t process = process_of(program.process(), killed);
    REQUIRE(process != 0);
    REQUIRE(::kill(process, SIGKILL) == 0);
    const auto before = std::chrono::steady_clock::now();
    const Outcome outcome = program.wait();
    CHECK(std::chrono::steady_clock::now() - before < 20s);
    INFO(outcome.err);
    CHECK(outcome.code != 0);
    CHECK(sentences(outcome.err) == 1);
    CHECK(
        contains(outcome.err, "Rank " + std::to_string(killed) + " of the 3 that share this work"));
    CHECK(contains(outcome.err, "--resume"));
    const std::int64_t reached = raysplats::load_latest_checkpoint(run).iteration;
    for (const auto& path : raysplats::list_checkpoints(run)) raysplats::read_checkpoint(path);
    const Outcome resumed = raysplats_program(
        shared_training(run) + Words{"--resume", "latest", "-n", std::to_string(reached + 3)},
        mpirun(2));
    INFO(resumed.err);
    CHECK(resumed.code == 0);
  }
}
