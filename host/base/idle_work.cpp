// SPDX-License-Identifier: Apache-2.0
#include "base/idle_work.hpp"

#include <utility>

namespace raysplats {

IdleWork::~IdleWork() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  changed_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void IdleWork::add(std::function<void()> task) {
  {
    const std::lock_guard lock(mutex_);
    tasks_.push_back(std::move(task));
    last_ = Clock::now();
    if (!thread_.joinable()) thread_ = std::thread([this] { run(); });
  }
  changed_.notify_all();
}

void IdleWork::postpone() {
  const std::lock_guard lock(mutex_);
  last_ = Clock::now();
}

void IdleWork::run() {
  std::unique_lock lock(mutex_);
  while (!ending_) {
    if (tasks_.empty()) {
      changed_.wait(lock);
    } else if (const auto due = last_ + quiet_; Clock::now() < due) {
      changed_.wait_until(lock, due);
    } else {
      const std::function<void()> task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      task();
      lock.lock();
    }
  }
}

}  // namespace raysplats
