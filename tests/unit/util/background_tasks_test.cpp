// SPDX-License-Identifier: Apache-2.0
#include "util/background_tasks.hpp"

#include <doctest/doctest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <stdexcept>
#include <thread>

using namespace raysplats;

TEST_CASE("background tasks: whoever hands them in goes on, up to the limit") {
  std::promise<void> gate;
  const std::shared_future<void> opened(gate.get_future());
  std::atomic<int> done = 0;
  BackgroundTasks tasks(2);
  for (int i = 0; i < 2; ++i) {
    tasks.add(0, [&] {
      opened.wait();
      ++done;
    });
  }
  CHECK(done == 0);  // add() came back before they ended
  gate.set_value();
  tasks.finish();
  CHECK(done == 2);
}

TEST_CASE("background tasks: no more run at once than asked for, and all run") {
  const auto most_at_once = [](BackgroundTasks tasks, std::size_t bytes) {
    std::atomic<int> running = 0, most = 0, done = 0;
    for (int i = 0; i < 40; ++i) {
      tasks.add(bytes, [&] {
        const int now = ++running;
        for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        --running;
        ++done;
      });
    }
    tasks.finish();
    CHECK(done == 40);
    return most.load();
  };
  CHECK(most_at_once(BackgroundTasks(3), 1) <= 3);
  CHECK(most_at_once(BackgroundTasks(8, 25), 10) <= 2);
  CHECK(most_at_once(BackgroundTasks(8, 25), 100) == 1);
}

TEST_CASE("background tasks: what one throws reaches who hands in another, or waits") {
  const auto fail = [] { throw std::runtime_error("disk full"); };
  BackgroundTasks tasks(1);
  tasks.add(0, fail);
  bool started = false;
  CHECK_THROWS_WITH_AS(tasks.add(0, [&] { started = true; }), "disk full", std::runtime_error);
  CHECK_FALSE(started);
  tasks.add(0, fail);
  CHECK_THROWS_WITH_AS(tasks.finish(), "disk full", std::runtime_error);
  tasks.finish();
}
