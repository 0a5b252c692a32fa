// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <thread>
#include <utility>

namespace raysplats {

/// Tasks that run on threads of their own while whoever hands them in goes on. The destructor waits
/// for all; what they throw by then is lost.
class BackgroundTasks {
 public:
  /// As many run at once as there are threads, and as hold `bytes` together.
  explicit BackgroundTasks(std::size_t threads = std::max(1u, std::thread::hardware_concurrency()),
                           std::size_t bytes = std::size_t{512} << 20)
      : threads_(threads), most_bytes_(bytes) {}

  /// Waits until there is room for a task that holds so many bytes (one alone may hold any number),
  /// then starts it. Throws what an earlier one has thrown; the new one is not started then.
  void add(std::size_t bytes, std::function<void()> task) {
    while (!tasks_.empty() && (tasks_.size() >= threads_ || held_ + bytes > most_bytes_))
      wait_for_oldest();
    tasks_.push_back({bytes, std::async(std::launch::async, std::move(task))});
    held_ += bytes;
  }

  /// Waits for all. Throws what the oldest that failed has thrown.
  void finish() {
    while (!tasks_.empty()) wait_for_oldest();
  }

 private:
  struct Task {
    std::size_t bytes;
    std::future<void> end;
  };

  void wait_for_oldest() {
    Task oldest = std::move(tasks_.front());
    tasks_.pop_front();
    held_ -= oldest.bytes;
    oldest.end.get();
  }

  std::size_t threads_, most_bytes_;
  std::size_t held_ = 0;
  std::deque<Task> tasks_;
};

}  // namespace raysplats
