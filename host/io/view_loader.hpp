// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <exception>
#include <memory>
#include <mutex>
#include <span>
#include <stop_token>
#include <thread>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// A view's picture, 8 bits a channel and straight alpha: r | g << 8 | b << 16 | a << 24, row by
/// row.
struct PackedImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> pixels;
  /// How much each pixel counts, 0 to 255; empty where ViewPicture::weight is.
  std::vector<std::uint8_t> weights;

  std::size_t bytes() const { return pixels.size() * sizeof(std::uint32_t) + weights.size(); }
};

/// Rounds an RGBA image to 8 bits a channel, clamped to [0, 1].
PackedImage pack(const Image& rgba);
PackedImage pack(const ViewPicture& picture);

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
  /// returned too, but not kept. Throws the DataError of load_view_image(), and again on the next
  /// call if it still fails.
  std::shared_ptr<const PackedImage> get(std::size_t index);

  /// Bytes of the pictures kept now: within the budget but for those that get() is about to return.
  std::size_t cached_bytes() const;

 private:
  enum class State { kIdle, kQueued, kLoading, kReady, kFailed };
  struct Entry {
    State state = State::kIdle;
    bool wanted = false;      ///< prefetched and not yet used: evicted last
    std::size_t waiting = 0;  ///< callers of get() that wait for it
    std::uint64_t last_use = 0;
    std::shared_ptr<const PackedImage> image;
    std::exception_ptr error;
  };

  void work(const std::stop_token& stop);
  void store(std::size_t index, std::shared_ptr<const PackedImage> image);
  void make_room(std::size_t bytes);
  std::size_t view_bytes(std::size_t index) const;

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
