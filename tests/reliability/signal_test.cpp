// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "device/context.hpp"
#include "parallel/scan.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "run/checkpoint.hpp"
#include "tiny_run.hpp"
#include "unit/fixture.hpp"

namespace {

using namespace std::chrono_literals;

// A run that would take for ever.
Words endless(const std::string& run) {
  return tiny_training(run) + Words{"-n", "100000000", "--log-level", "error"};
}

// Waits until the run has written a checkpoint.
void wait_for_checkpoint(RunningProgram& program, const std::string& run) {
  for (int i = 0; i < 3000 && raysplats::list_checkpoints(run).empty(); ++i) {
    REQUIRE(program.runs());
    std::this_thread::sleep_for(10ms);
  }
}

// Makes a named pipe; returns its end to read from.
int open_pipe(const std::string& path) {
  REQUIRE(::mkfifo(path.c_str(), 0600) == 0);
  const int reader = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  REQUIRE(reader >= 0);
  return reader;
}

bool every_checkpoint_is_whole(const std::string& run) {
  for (const auto& path : raysplats::list_checkpoints(run)) {
    try {
      raysplats::read_checkpoint(path);
    } catch (const raysplats::Error&) {
      return false;
    }
  }
  return true;
}

}  // namespace

TEST_CASE("SIGINT, SIGTERM and SIGHUP finish the iteration, save and end with 130") {
  const TemporaryFolder folder;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    CAPTURE(signal);
    const std::string run = folder / std::to_string(signal);
    RunningProgram program(endless(run));
    wait_for_checkpoint(program, run);
    REQUIRE(::kill(program.process(), signal) == 0);
    const Outcome outcome = program.wait();
    INFO(outcome.err);
    CHECK(outcome.code == 130);
    CHECK(one_sentence(outcome));
    CHECK(contains(outcome.err, "--resume"));
    const raysplats::Checkpoint newest = raysplats::load_latest_checkpoint(run);
    CHECK(contains(outcome.err, "iteration " + std::to_string(newest.iteration)));
    CHECK(std::filesystem::exists(model_of(run, static_cast<int>(newest.iteration))));
    CHECK(temporaries(run) == 0);
    const std::string page = run + "/report.html";
    REQUIRE(std::filesystem::exists(page));
    CHECK(contains(read_file(page), "Not over"));
    CHECK(contains(outcome.out, "Report: " + page));
  }
}

TEST_CASE("a run whose terminal is closed saves all, and one under nohup goes on") {
  const TemporaryFolder folder;
  const auto is_saved = [](const std::string& run) {
    const raysplats::Checkpoint newest = raysplats::load_latest_checkpoint(run);
    return std::filesystem::exists(model_of(run, static_cast<int>(newest.iteration))) &&
           std::filesystem::exists(run + "/report.html") && temporaries(run) == 0;
  };
  SUBCASE("its own") {
    Surroundings there;
    there.terminal = true;
    RunningProgram program(endless(folder / "run"), there);
    wait_for_checkpoint(program, folder / "run");
    program.hang_up();
    // The system and the shell both say so, and some systems end what is left of a session.
    for (const int signal : {SIGHUP, SIGHUP, SIGTERM})
      REQUIRE(::kill(program.process(), signal) == 0);
    CHECK(program.wait().code == 130);
    CHECK(is_saved(folder / "run"));
  }
  SUBCASE("that of a program which reads what it prints, as in train | tee") {
    const std::string pipe = folder / "pipe";
    const int reader = open_pipe(pipe);
    Surroundings there;
    there.out_file = there.err_file = pipe;
    RunningProgram program(endless(folder / "run"), there);
    wait_for_checkpoint(program, folder / "run");
    REQUIRE(::close(reader) == 0);
    REQUIRE(::kill(program.process(), SIGHUP) == 0);
    CHECK(program.wait().code == 130);
    CHECK(is_saved(folder / "run"));
  }
  SUBCASE("that of a program which has read enough, as in train | head") {
    const std::string pipe = folder / "pipe";
    const int reader = open_pipe(pipe);
    Surroundings there;
    there.out_file = there.err_file = pipe;
    // A line of each evaluation.
    Words words = tiny_training(folder / "run") +
                  Words{"-n", "100000000", "--eval-every", "5", "--eval-renders", "0"};
    std::erase(words, "-q");
    RunningProgram program(words, there);
    wait_for_checkpoint(program, folder / "run");
    REQUIRE(::close(reader) == 0);
    CHECK(program.wait().code == 130);
    CHECK(is_saved(folder / "run"));
  }
  SUBCASE("nohup") {
    Surroundings there;
    there.nohup = true;
    RunningProgram program(endless(folder / "run"), there);
    wait_for_checkpoint(program, folder / "run");
    REQUIRE(::kill(program.process(), SIGHUP) == 0);
    const auto reached = [&] {
      return raysplats::load_latest_checkpoint(folder / "run").iteration;
    };
    for (const std::int64_t begin = reached(); reached() < begin + 20;) {
      REQUIRE(program.runs());
      std::this_thread::sleep_for(10ms);
    }
  }
}

TEST_CASE("an interrupted run whose report cannot be written says and ends the same") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  RunningProgram program(endless(run));
  wait_for_checkpoint(program, run);
  // A folder is in the page's way.
  std::filesystem::create_directories(run + "/report.html/in the way");
  REQUIRE(::kill(program.process(), SIGINT) == 0);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.code == 130);
  CHECK(contains(outcome.err, "Interrupted at iteration"));
  CHECK(contains(outcome.err, "--resume"));
}

TEST_CASE("a second signal of another kind ends the run at once with whole files") {
  const TemporaryFolder folder;
  for (const auto& [first, second] : {std::pair{SIGINT, SIGTERM}, {SIGTERM, SIGINT}}) {
    const std::string run = folder / std::to_string(second);
    CAPTURE(run);
    RunningProgram program(endless(run));
    wait_for_checkpoint(program, run);
    // Both wait while the process is stopped, and are delivered together.
    REQUIRE(::kill(program.process(), SIGSTOP) == 0);
    REQUIRE(::kill(program.process(), first) == 0);
    REQUIRE(::kill(program.process(), second) == 0);
    REQUIRE(::kill(program.process(), SIGCONT) == 0);
    const Outcome outcome = program.wait();
    INFO(outcome.err);
    CHECK((outcome.signal == first || outcome.signal == second));
    CHECK(every_checkpoint_is_whole(run));
    const std::int64_t reached = raysplats::load_latest_checkpoint(run).iteration;
    const Outcome resumed = raysplats_program(
        tiny_training(run) + Words{"--resume", "latest", "-n", std::to_string(reached)});
    INFO(resumed.err);
    CHECK(resumed.code == 0);
    CHECK(temporaries(run) == 0);
  }
}

TEST_CASE("a second signal of the same kind ends the run at once with whole files") {
  const TemporaryFolder folder;
  for (const int signal : {SIGINT, SIGTERM}) {
    CAPTURE(signal);
    // A run may be so quick that it has saved and ended by itself before the second signal comes;
    // not every time.
    int ended_by = 0;
    for (int attempt = 0; attempt < 10 && ended_by == 0; ++attempt) {
      CAPTURE(attempt);
      const std::string run = folder / (std::to_string(signal) + "_" + std::to_string(attempt));
      RunningProgram program(endless(run));
      wait_for_checkpoint(program, run);
      while (program.runs() && ::kill(program.process(), signal) == 0)
        std::this_thread::sleep_for(1ms);
      const Outcome outcome = program.wait();
      INFO(outcome.err);
      ended_by = outcome.signal;
      if (ended_by == 0) CHECK(outcome.code == 130);
      CHECK(every_checkpoint_is_whole(run));
    }
    CHECK(ended_by == signal);
  }
}

TEST_CASE("a signal ends a long frame between its samples, with 130 though it is the last one") {
  const TemporaryFolder folder;
  write_file(folder / "wall.obj", "v -1 -1 0\nv 1 -1 0\nv 0 1 0\nf 1 2 3\n");
  // Hours of samples.
  write_file(folder / "scene.toml",
             "[[mesh]]\nfile = \"wall.obj\"\n[camera]\nposition = [0, 0, -4]\ntarget = [0, 0, 0]\n"
             "width = 300\nheight = 300\n[render]\nsamples = 65536\n");
  RunningProgram program({"render", folder / "scene.toml", "-o", folder / "frames"});
  while (program.runs() && !contains(program.errors(), "% of this frame"))
    std::this_thread::sleep_for(10ms);
  REQUIRE(::kill(program.process(), SIGINT) == 0);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.signal == 0);
  CHECK(outcome.code == 130);
  CHECK(contains(outcome.err, "Interrupted after 0 of 1 frames"));
  CHECK(entries(folder / "frames") == 0);
}

TEST_CASE("a signal ends a long frame of a model, is told of at once and ends with 130") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(40));
  // Seconds of tracing: in packets, and ray by ray.
  for (const Words& how : {Words{}, Words{"--traversal", "bvh"}}) {
    Surroundings terminal;
    terminal.terminal = true;
    RunningProgram program(Words{"render", folder / "model.ply", "--orbit", "1", "--width", "3000",
                                 "-o", folder / "frames"} +
                               how,
                           terminal);
    while (program.runs() && !contains(program.errors(), "% of this frame"))
      std::this_thread::sleep_for(10ms);
    REQUIRE(::kill(program.process(), SIGINT) == 0);
    while (program.runs() && !contains(program.errors(), "once more stops at once"))
      std::this_thread::sleep_for(10ms);
    const Outcome outcome = program.wait();
    INFO(outcome.err);
    CHECK(contains(outcome.err, "Interrupted: stopping as soon as"));
    CHECK(outcome.signal == 0);
    CHECK(outcome.code == 130);
    CHECK(contains(outcome.err, "Interrupted after 0 of 1 frames"));
    CHECK(entries(folder / "frames") == 0);
  }
}

TEST_CASE("a signal ends an evaluation within a view, with 130") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(40));
  REQUIRE(raysplats_program({"generate", "-o", folder / "data", "--size", "1200", "--train-views",
                             "2", "--test-views", "1"})
              .code == 0);
  RunningProgram program({"eval", folder / "model.ply", "--data", folder / "data", "-o",
                          folder / "eval", "--traversal", "bvh"});
  while (program.runs() && !contains(program.errors(), "% of this frame"))
    std::this_thread::sleep_for(10ms);
  REQUIRE(::kill(program.process(), SIGINT) == 0);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.code == 130);
  CHECK(contains(outcome.err, "Interrupted after 0 of 1 views"));
  CHECK(entries(folder / "eval") == 0);
}

TEST_CASE("a signal breaks off an evaluation of a run, which the resumed run makes up for") {
  const TemporaryFolder folder;
  // Seconds of evaluation: a picture of every view is written too.
  REQUIRE(raysplats_program({"generate", "-o", folder / "data", "--size", "200", "--train-views",
                             "4", "--test-views", "60", "-q"})
              .code == 0);
  // One before density control, and the last one.
  for (const int at : {16, kIterations}) {
    CAPTURE(at);
    const auto training = [&](const std::string& name) {
      Words words = tiny_training(folder / (name + std::to_string(at))) +
                    Words{"--eval-at", std::to_string(at), "--eval-renders", "60"};
      words[1] = folder / "data";
      return words;
    };
    const std::string whole = training("whole")[3], run = training("broken")[3];
    const std::string evaluation = "/eval/iteration_" + std::to_string(at);
    REQUIRE(raysplats_program(training("whole")).code == 0);

    Words words = training("broken");
    std::erase(words, "-q");
    Surroundings there;
    there.terminal = true;
    RunningProgram program(words, there);
    while (program.runs() && !contains(program.errors(), "Evaluating"))
      std::this_thread::sleep_for(1ms);
    REQUIRE(::kill(program.process(), SIGTERM) == 0);
    const Outcome outcome = program.wait();
    INFO(outcome.err);
    CHECK(outcome.code == 130);
    CHECK(contains(outcome.err, "Interrupted at iteration " + std::to_string(at)));
    CHECK(!contains(outcome.err, "60 test views"));
    CHECK(std::filesystem::exists(model_of(run, at)));
    CHECK(raysplats::load_latest_checkpoint(run).iteration == at);
    CHECK(!std::filesystem::exists(run + evaluation));
    const std::string state =
        at < kIterations ? "not over: 16 of 30 iterations" : "though all 30 iterations are done";
    CHECK(contains(read_file(run + "/report.html"), state));
    CHECK(temporaries(run) == 0);

    const Outcome resumed = raysplats_program(training("broken") + Words{"--resume", "latest"});
    INFO(resumed.err);
    REQUIRE(resumed.code == 0);
    CHECK(same_result(run, whole));
    const std::string measures = read_file(run + evaluation + "/metrics.json");
    CHECK(!measures.empty());
    CHECK(measures == read_file(whole + evaluation + "/metrics.json"));
    CHECK(entries(run + evaluation) == entries(whole + evaluation));
  }
}

TEST_CASE("a folder takes one run at a time, and a lock that was left behind none") {
  const TemporaryFolder folder;
  const std::string run = folder / "run";
  RunningProgram first(endless(run));
  wait_for_checkpoint(first, run);
  for (const Words& more : {Words{}, Words{"--resume", "latest"}}) {
    const Outcome second = raysplats_program(tiny_training(run) + more);
    INFO(second.err);
    CHECK(second.code == 3);
    CHECK(one_sentence(second));
    CHECK(contains(second.err, run));
    CHECK(contains(second.err, "process " + std::to_string(first.process())));
  }
  CHECK(first.runs());
  REQUIRE(::kill(first.process(), SIGKILL) == 0);
  CHECK(first.wait().code == 128 + SIGKILL);
  REQUIRE(std::filesystem::exists(std::filesystem::path(run) / ".lock"));
  const std::int64_t reached = raysplats::load_latest_checkpoint(run).iteration;
  const Outcome resumed = raysplats_program(
      tiny_training(run) + Words{"--resume", "latest", "-n", std::to_string(reached + 2)});
  INFO(resumed.err);
  CHECK(resumed.code == 0);
}

TEST_CASE("eight processes fill one kernel cache at once") {
  // PoCL keeps kernels in a folder of its own, or where it keeps none is asked for binaries.
  for (const bool driver_keeps : {true, false}) {
    CAPTURE(driver_keeps);
    const TemporaryFolder folder;
    std::vector<pid_t> children;
    for (int i = 0; i < 8; ++i) {
      const pid_t child = ::fork();
      REQUIRE(child >= 0);
      if (child == 0) {
        // Nothing in this program has used OpenCL before, so that every child has its own.
        int status = 1;
        const std::string own = driver_keeps ? "" : std::to_string(i);
        ::setenv("POCL_CACHE_DIR", (folder / ("driver" + own)).c_str(), 1);
        ::setenv("POCL_KERNEL_CACHE", driver_keeps ? "1" : "0", 1);
        try {
          raysplats::ContextOptions options;
          options.cache_directory = folder / "cache";
          raysplats::Context context(raysplats::test_device(), options);
          raysplats::Scan scan(context);
          raysplats::Buffer<std::uint32_t> values(context, 4, "values");
          values.upload(std::array<std::uint32_t, 4>{5, 6, 7, 0});
          scan.exclusive(values, 3);
          status = values.download() == std::vector<std::uint32_t>{0, 5, 11, 18} ? 0 : 2;
        } catch (const std::exception& error) {
          std::fprintf(stderr, "%s\n", error.what());
        }
        ::_exit(status);
      }
      children.push_back(child);
    }
    for (const pid_t child : children) {
      int status = -1;
      CHECK(::waitpid(child, &status, 0) == child);
      CHECK(status == 0);
    }
    std::size_t kept = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder / "cache")) {
      if (entry.path().filename() == ".lock") continue;  // they take turns by it
      CHECK(entry.path().extension() == ".bin");         // nothing half-written stays
      ++kept;
    }
    CHECK(kept >= 1);
  }
}
