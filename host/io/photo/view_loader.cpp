// SPDX-License-Identifier: Apache-2.0
#include "io/photo/view_loader.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "raysplats/error.hpp"

namespace raysplats::io {

ViewLoader::ViewLoader(std::vector<View> views, std::size_t budget_bytes, unsigned threads)
    : views_(std::move(views)), budget_(budget_bytes), entries_(views_.size()) {
  if (threads == 0) threads = std::max(1u, std::thread::hardware_concurrency());
  threads = static_cast<unsigned>(std::min<std::size_t>(threads, views_.size()));
  for (unsigned i = 0; i < threads; ++i) {
    workers_.emplace_back([this](const std::stop_token& stop) { work(stop); });
  }
}

ViewLoader::~ViewLoader() {
  for (std::jthread& worker : workers_) worker.request_stop();
}

void ViewLoader::prefetch(std::span<const std::size_t> indices) {
  {
    const std::lock_guard lock(mutex_);
    std::deque<std::size_t> kept;
    for (const std::size_t index : queue_) {
      if (entries_[index].waiting > 0) {
        kept.push_back(index);
      } else {
        entries_[index].state = State::kIdle;
      }
    }
    queue_ = std::move(kept);
    for (Entry& entry : entries_) entry.wanted = false;
    std::size_t bytes = 0;
    for (const std::size_t index : indices) {
      if (index >= views_.size() || entries_[index].wanted) continue;
      bytes += photo_bytes(views_[index]);
      if (bytes > budget_) break;
      Entry& entry = entries_[index];
      entry.wanted = true;
      if (entry.state == State::kIdle) {
        entry.state = State::kQueued;
        queue_.push_back(index);
      }
    }
  }
  work_available_.notify_all();
}

std::shared_ptr<const Photo> ViewLoader::get(std::size_t index) {
  std::unique_lock lock(mutex_);
  if (index >= views_.size()) {
    throw UsageError(
        fmt::format("View {} was asked for, but there are {} views", index, views_.size()));
  }
  Entry& entry = entries_[index];
  ++entry.waiting;
  std::shared_ptr<const Photo> image;
  std::exception_ptr error;
  while (true) {
    if (entry.state == State::kReady) {
      image = entry.image;
      break;
    }
    if (entry.state == State::kFailed) {
      error = entry.error;
      break;
    }
    if (entry.state == State::kQueued) {
      queue_.erase(std::find(queue_.begin(), queue_.end(), index));
    }
    if (entry.state != State::kLoading) {
      entry.state = State::kQueued;
      queue_.push_front(index);
      work_available_.notify_one();
    }
    finished_.wait(lock,
                   [&] { return entry.state == State::kReady || entry.state == State::kFailed; });
  }
  --entry.waiting;
  entry.wanted = false;
  entry.last_use = ++clock_;
  if (error) {
    if (entry.waiting == 0) {
      entry.state = State::kIdle;
      entry.error = nullptr;
    }
    std::rethrow_exception(error);
  }
  if (entry.waiting == 0 && cached_bytes_ > budget_) make_room(0);
  return image;
}

bool ViewLoader::wait(std::size_t index, double seconds) {
  std::unique_lock lock(mutex_);
  if (index >= views_.size()) return true;
  const Entry& entry = entries_[index];
  return finished_.wait_for(lock, std::chrono::duration<double>(seconds), [&] {
    return entry.state == State::kReady || entry.state == State::kFailed;
  });
}

void ViewLoader::forget(std::size_t index) {
  const std::lock_guard lock(mutex_);
  if (index >= views_.size()) return;
  Entry& entry = entries_[index];
  if (entry.state != State::kReady || entry.waiting > 0) return;
  cached_bytes_ -= entry.image->bytes();
  entry.image = nullptr;
  entry.state = State::kIdle;
}

std::optional<Sharpness> ViewLoader::sharpness_of(std::size_t index) const {
  const std::lock_guard lock(mutex_);
  return index < views_.size() ? entries_[index].sharpness : std::nullopt;
}

std::size_t ViewLoader::cached_bytes() const {
  const std::lock_guard lock(mutex_);
  return cached_bytes_;
}

void ViewLoader::make_room(std::size_t bytes) {
  while (cached_bytes_ > 0 && cached_bytes_ + bytes > budget_) {
    Entry* victim = nullptr;
    for (Entry& entry : entries_) {
      if (entry.state != State::kReady || entry.waiting > 0) continue;
      const bool older = victim == nullptr || entry.wanted < victim->wanted ||
                         (entry.wanted == victim->wanted && entry.last_use < victim->last_use);
      if (older) victim = &entry;
    }
    if (victim == nullptr) return;
    cached_bytes_ -= victim->image->bytes();
    victim->image = nullptr;
    victim->state = State::kIdle;
  }
}

void ViewLoader::store(std::size_t index, std::shared_ptr<const Photo> image) {
  Entry& entry = entries_[index];
  make_room(image->bytes());
  cached_bytes_ += image->bytes();
  entry.last_use = ++clock_;
  entry.image = std::move(image);
  entry.state = State::kReady;
}

void ViewLoader::work(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (work_available_.wait(lock, stop, [this] { return !queue_.empty(); })) {
    if (stop.stop_requested()) return;
    const std::size_t index = queue_.front();
    queue_.pop_front();
    entries_[index].state = State::kLoading;
    std::optional<Sharpness> sharpness = entries_[index].sharpness;
    lock.unlock();
    std::shared_ptr<const Photo> image;
    std::exception_ptr error;
    try {
      image = std::make_shared<const Photo>(load_photo(views_[index]));
      if (!sharpness) sharpness = io::sharpness(*image);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    entries_[index].sharpness = sharpness;
    if (error) {
      entries_[index].error = error;
      entries_[index].state = State::kFailed;
    } else {
      store(index, std::move(image));
    }
    finished_.notify_all();
  }
}

}  // namespace raysplats::io
