// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "io/view_loader.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats {

/// Photos as the loss wants them: packed RGBA8 on the device. The first ones that fit the budget
/// stay there; the others are loaded again whenever they are asked for (every view comes once per
/// pass, so replacing the oldest one would never find anything).
class TargetCache {
 public:
  /// `budget` in bytes is for the device; the host keeps `host_budget` bytes of photos to reduce or
  /// pass on.
  TargetCache(Context& context,
              std::vector<View> views,
              std::size_t budget,
              std::size_t host_budget);

  /// The photo of a view (an index into `views`) reduced to width x height (area average). Where
  /// the view's mask is apart, a word per pixel with its weight, 0 to 255, follows.
  const Buffer<std::uint32_t>& get(std::size_t view, int width, int height);

  /// Decodes these photos in the background as far as they are not on the device.
  void prefetch(std::span<const std::size_t> views);

  std::size_t cached_bytes() const { return cached_; }

 private:
  struct Entry {
    int width = 0;
    int height = 0;
    Buffer<std::uint32_t> pixels;
  };

  Context& context_;
  std::size_t budget_;
  std::size_t cached_ = 0;
  std::vector<Entry> entries_;
  Entry passing_;  // the view that found no room
  io::ViewLoader loader_;
};

}  // namespace raysplats
