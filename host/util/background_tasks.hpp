// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <functional>
#include <future>
#include <utility>

namespace raysplats {

/// Tasks that run on threads of their own while whoever hands them in goes on. The destructor waits
/// for all; what they throw by then is lost.
class BackgroundTasks {
 public:
  /// Waits until fewer than `most` (1 or more) are running, then starts one more. Throws what an
  /// earlier one has thrown; the new one is not started then.
  void add(std::size_t most, std::function<void()> task) {
    while (tasks_.size() >= most) wait_for_oldest();
    tasks_.push_back(std::async(std::launch::async, std::move(task)));
  }

  /// Waits for all. Throws what the oldest that failed has thrown.
  void finish() {
    while (!tasks_.empty()) wait_for_oldest();
  }

 private:
  void wait_for_oldest() {
    std::future<void> oldest = std::move(tasks_.front());
    tasks_.pop_front();
    oldest.get();
  }

  std::deque<std::future<void>> tasks_;
};

}  // namespace raysplats
