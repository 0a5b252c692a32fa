// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

namespace raysplats {

/// Work that may wait, done by a thread of its own, in order, one task at a time, once nothing has
/// been added or postponed for a while. Tasks must not throw. The thread exists from the first task
/// on.
class IdleWork {
 public:
  explicit IdleWork(std::chrono::milliseconds quiet) : quiet_(quiet) {}
  /// Waits for the task that runs; those that have not begun are dropped.
  ~IdleWork();
  IdleWork(const IdleWork&) = delete;
  IdleWork& operator=(const IdleWork&) = delete;

  void add(std::function<void()> task);
  /// The time that has to pass begins anew.
  void postpone();

 private:
  using Clock = std::chrono::steady_clock;

  void run();

  std::chrono::milliseconds quiet_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> tasks_;
  Clock::time_point last_ = Clock::now();
  bool ending_ = false;
  std::thread thread_;
};

}  // namespace raysplats
