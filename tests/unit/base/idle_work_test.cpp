// SPDX-License-Identifier: Apache-2.0
#include "base/idle_work.hpp"

#include <doctest/doctest.h>

#include <future>
#include <vector>

using namespace raysplats;
using namespace std::chrono_literals;

TEST_CASE("idle work: tasks run in order, in another thread") {
  std::vector<int> done;
  std::promise<std::thread::id> last;
  IdleWork work(0ms);
  for (int i = 0; i < 5; ++i) work.add([&, i] { done.push_back(i); });
  work.add([&] { last.set_value(std::this_thread::get_id()); });
  CHECK(last.get_future().get() != std::this_thread::get_id());
  CHECK(done == std::vector{0, 1, 2, 3, 4});
}

TEST_CASE("idle work: waits until nothing has come for a while") {
  constexpr auto kQuiet = 200ms;
  const auto begin = std::chrono::steady_clock::now();
  std::promise<std::chrono::steady_clock::time_point> ran;
  IdleWork work(kQuiet);
  work.add([&] { ran.set_value(std::chrono::steady_clock::now()); });
  std::this_thread::sleep_for(kQuiet / 2);
  const auto postponing = std::chrono::steady_clock::now();
  work.postpone();
  const bool in_time = std::chrono::steady_clock::now() < begin + kQuiet;
  const auto time = ran.get_future().get();
  // A slow machine may be late with it.
  if (in_time) CHECK(time >= postponing + kQuiet);
  CHECK(time >= begin + kQuiet);
}

TEST_CASE("idle work: what has not begun ends with it, what runs is waited for") {
  bool finished = false, other = false;
  {
    IdleWork later(1h);
    later.add([&] { other = true; });
    std::promise<void> begun;
    IdleWork work(0ms);
    work.add([&] {
      begun.set_value();
      std::this_thread::sleep_for(50ms);
      finished = true;
    });
    begun.get_future().wait();
  }
  CHECK(finished);
  CHECK_FALSE(other);
}
