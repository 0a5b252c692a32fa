// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <stop_token>
#include <thread>
#include <vector>

#include "io/photo/photo.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Loads the pictures of a data set in worker threads and keeps those used last within a byte
/// budget. All members may be called from several threads.
class ViewLoader {
 public:
  /// `threads` workers, 0 for one per core. Nothing is loaded before it is asked for.
  ViewLoader(std::vector<View> views, std::size_t budget_bytes, unsigned threads = 0);
  ~ViewLoader();
  ViewLoader(const ViewLoader&) = delete;
  ViewLoader& operator=(const ViewLoader&) = delete;

  std::size_t size() const { return views_.size(); }

  /// Loads these views in this order in the background, as many of them as fit the budget. Replaces
  /// what an earlier call asked for and has not been started. Indices out of range are ignored.
  void prefetch(std::span<const std::size_t> indices);

  /// The picture of a view; waits when it is not there yet. A picture larger than the budget is
  /// returned too, but not kept. Throws the DataError of load_view_picture(), and again on the next
  /// call if it still fails.
  std::shared_ptr<const Photo> get(std::size_t index);

  /// Waits at most so many seconds for a picture that prefetch() has asked for; returns whether
  /// get() has nothing to wait for.
  bool wait(std::size_t index, double seconds);

  /// Keeps this picture no longer: its bytes lie elsewhere.
  void forget(std::size_t index);

  /// How sharp a picture is, found when it was first loaded; none for one that has not been.
  std::optional<Sharpness> sharpness_of(std::size_t index) const;

  /// Bytes of the pictures kept now: within the budget but for those that get() is about to return.
  std::size_t cached_bytes() const;

 private:
  enum class State { kIdle, kQueued, kLoading, kReady, kFailed };
  struct Entry {
    State state = State::kIdle;
    bool wanted = false;      ///< prefetched and not yet used: evicted last
    std::size_t waiting = 0;  ///< callers of get() that wait for it
    std::uint64_t last_use = 0;
    std::shared_ptr<const Photo> image;
    std::exception_ptr error;
    std::optional<Sharpness> sharpness;
  };

  void work(const std::stop_token& stop);
  void store(std::size_t index, std::shared_ptr<const Photo> image);
  void make_room(std::size_t bytes);

  const std::vector<View> views_;
  const std::size_t budget_;
  mutable std::mutex mutex_;
  std::condition_variable_any work_available_;
  std::condition_variable finished_;
  std::vector<Entry> entries_;
  std::deque<std::size_t> queue_;
  std::size_t cached_bytes_ = 0;
  std::uint64_t clock_ = 0;
  std::vector<std::jthread> workers_;  ///< last, so that it stops before the rest is destroyed
};

}  // namespace raysplats::io
