// SPDX-License-Identifier: Apache-2.0
#include "util/progress.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <optional>
#include <utility>

#include "util/interrupt.hpp"

using namespace raysplats;

TEST_CASE("durations read as a clock") {
  CHECK(format_duration(0) == "0:00");
  CHECK(format_duration(65.4) == "1:05");
  CHECK(format_duration(7384) == "2:03:04");
  CHECK(format_duration(-3) == "0:00");
  CHECK(format_duration(1e300) == format_duration(1e12));
}

TEST_CASE("the progress line fits its width and shows the state") {
  Progress progress("Training", 200, 0, nullptr);
  progress.update(50, "loss 0.5");
  for (const int width : {1, 10, 40, 80, 200})
    CHECK(progress.line(width).size() <= static_cast<std::size_t>(width));
  const std::string line = progress.line(120);
  CHECK(line.find("50/200") != std::string::npos);
  CHECK(line.find("loss 0.5") != std::string::npos);
  CHECK(line.find("left") != std::string::npos);
  CHECK(progress.rate() > 0);
  Progress open("Compiling", Progress::kUnknown, 0, nullptr);
  for (int i = 1; i < 100; ++i) {
    open.update(i, "a.cl");
    const std::string bar = open.line(60);
    CHECK(bar.size() <= 60);
    CHECK(bar.find("===") != std::string::npos);
    CHECK(bar.find("] " + std::to_string(i) + ", a.cl") != std::string::npos);
    CHECK(bar.find("left") == std::string::npos);
  }
  // Far too many steps a second to be told.
  Progress fast("Bytes", std::int64_t{1} << 50, 0, nullptr);
  fast.update(std::int64_t{1} << 40, "");
  CHECK(fast.rate() > 1e9);
  CHECK(fast.line(120).find("it/s") == std::string::npos);
  CHECK(fast.line(120).find("left") != std::string::npos);
  Progress nothing("Empty", 0, 0, nullptr);
  CHECK(nothing.line(80).find("0/0") != std::string::npos);
}

TEST_CASE("a terminal of 80 columns shows the time left beside all that a training says") {
  Progress progress("Training", 10000, 0, nullptr);
  progress.update(1234, "loss 0.0213, PSNR 25.31 of this view, 123456 Gaussians");
  CHECK(progress.line(79).size() <= 79);
  CHECK(progress.line(79).find(" left") != std::string::npos);
}

namespace {

std::chrono::steady_clock::time_point moment;

}  // namespace

TEST_CASE("steps that last long, and tell of it meanwhile, are counted over all of their time") {
  Progress progress("Frames", 10, 0, nullptr, [] { return moment; });
  const auto step = [&](std::int64_t done) {
    for (int i = 0; i < 60; ++i) {
      moment += std::chrono::milliseconds(500);
      progress.update(done, "within a frame");
    }
    progress.update(done + 1, "");
  };
  step(0);
  CHECK(progress.rate() == doctest::Approx(1.0 / 30));
  CHECK(progress.line(120).find(" 1/10, 4:30 left") != std::string::npos);
  for (int i = 1; i < 4; ++i) step(i);
  CHECK(progress.rate() == doctest::Approx(1.0 / 30));
}

TEST_CASE("a first step that was short does not count as much as a long one behind it") {
  Progress progress("Frames", 10, 0, nullptr, [] { return moment; });
  moment += std::chrono::milliseconds(10);
  progress.update(1, "");
  moment += std::chrono::seconds(10);
  progress.update(2, "");
  CHECK(progress.rate() == doctest::Approx(0.2).epsilon(0.2));
}

TEST_CASE("work that turns out to be longer has another end in its progress") {
  Progress progress("Training", 100, 0, nullptr);
  progress.update(50, "");
  progress.set_total(200);
  CHECK(progress.line(120).find("50/200") != std::string::npos);
}

TEST_CASE("a stream that is no terminal gets plain lines without control characters") {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  REQUIRE(file);
  {
    Progress progress("Work", 10, 0, file.get());
    for (int i = 1; i <= 10; ++i) progress.update(i, "");
    progress.suspend();
    progress.resume();
    progress.finish();
    progress.finish();
  }
  std::rewind(file.get());
  std::string text(1000, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), file.get()));
  CHECK(text.find('\r') == std::string::npos);
  CHECK(text.find('\x1b') == std::string::npos);
  CHECK(text.find("10/10") != std::string::npos);
  CHECK(std::count(text.begin(), text.end(), '\n') == 2);  // the first state and the last
}

TEST_CASE("an interrupt is noted while a guard lives") {
  {
    const InterruptGuard guard;
    CHECK(!guard.requested());
    std::raise(SIGINT);
    CHECK(guard.requested());
  }
  const InterruptGuard fresh;
  CHECK(!fresh.requested());
  std::raise(SIGTERM);
  CHECK(fresh.requested());
}

TEST_CASE(
    "a guard hears signals after an older one has gone, and the last one puts back what was") {
  const auto handler = [] {
    struct sigaction present {};
    sigaction(SIGINT, nullptr, &present);
    return present.sa_handler;
  };
  const auto before = handler();
  {
    std::optional<InterruptGuard> first(std::in_place);
    const auto marks = handler();
    const InterruptGuard second;
    first.reset();
    REQUIRE((handler() == marks));
    std::raise(SIGINT);
    CHECK(second.requested());
  }
  CHECK((handler() == before));
}

TEST_CASE("a terminal that goes is an interrupt too, however often it says so, but not for nohup") {
  const auto before = std::signal(SIGHUP, SIG_DFL);
  if (before != SIG_IGN) {  // else the tests themselves run under nohup
    const InterruptGuard guard;
    for (int i = 0; i < 3; ++i) std::raise(SIGHUP);
    CHECK(guard.requested());
    std::raise(SIGTERM);  // as systems send it beside
  }
  CHECK((std::signal(SIGHUP, SIG_IGN) == SIG_DFL));
  {
    const InterruptGuard guard;
    std::raise(SIGHUP);
    CHECK(!guard.requested());
  }
  CHECK((std::signal(SIGHUP, before) == SIG_IGN));
}

TEST_CASE("a reader that goes is an interrupt where a guard says so, and is ignored from then on") {
  const auto before = std::signal(SIGPIPE, SIG_DFL);
  const auto handler = [] {
    struct sigaction present {};
    sigaction(SIGPIPE, nullptr, &present);
    return present.sa_handler;
  };
  {
    const InterruptGuard usual;
    CHECK((handler() == SIG_DFL));
    const InterruptGuard inner(LostReader::kInterrupts);  // as ranks have them beside an outer one
    CHECK((handler() != SIG_DFL));
  }
  CHECK((handler() == SIG_DFL));
  {
    const InterruptGuard guard(LostReader::kInterrupts);
    for (int i = 0; i < 3; ++i) std::raise(SIGPIPE);
    CHECK(guard.requested());
    std::raise(SIGINT);  // the first one that somebody sends
  }
  CHECK((handler() == SIG_IGN));
  {
    const InterruptGuard guard(LostReader::kInterrupts);
    std::raise(SIGPIPE);
    CHECK(!guard.requested());
  }
  std::signal(SIGPIPE, before);
}
