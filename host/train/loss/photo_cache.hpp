// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/kernel.hpp"
#include "device/upload_queue.hpp"
#include "io/photo/view_loader.hpp"
#include "raysplats/dataset.hpp"
#include "scene/image/pixel_mask.hpp"
#include "train/loss/device_photo.hpp"

namespace raysplats {

/// Photos on the device as the loss reads them, with the precision of their files. The first ones
/// that fit the budget stay there, and nowhere else; the others are loaded again whenever they are
/// asked for (every view comes once per pass, so replacing the oldest one would never find
/// anything). Smaller sizes are made on the device, from unrounded sums, for the step that asks.
/// Except on CPUs, whose memory they are in already, photos come to the device while it runs what
/// was enqueued before (UploadQueue).
class PhotoCache {
 public:
  /// `budget` in bytes of the device. The host holds `ahead` photos that are about to be asked for.
  PhotoCache(Context& context,
             const std::vector<View>& views,
             std::size_t budget,
             std::size_t ahead);

  /// The photo of a view (an index into `views`) reduced to width x height (area average), until
  /// the next call, without what leave_out() has marked. Waits for the file, not for the device.
  DevicePhoto get(std::size_t view, int width, int height);
  /// The same with what is marked.
  DevicePhoto get_whole(std::size_t view, int width, int height);

  /// From now on what `mask` marks, of any size, counts for nothing in the photo of a view; a mask
  /// of no size takes that back. `cut_out`: the photos' alpha is coverage, not how much they count.
  void leave_out(std::size_t view, const PixelMask& mask, bool cut_out);

  /// Decodes these photos in the background as far as they are not on the device.
  void prefetch(std::span<const std::size_t> views);

  /// How sharp a photo is; none for one that nothing has asked for yet.
  std::optional<Sharpness> sharpness_of(std::size_t view) const {
    return loader_.sharpness_of(view);
  }

  /// Bytes of the photos that stay on the device.
  std::size_t cached_bytes() const { return cached_; }

 private:
  struct Entry {
    int width = 0;
    int height = 0;
    int planes = 1;
    bool weighted = false;
    Buffer<std::uint32_t> words;
  };

  // A photo that found no room, and the moment from which on no step uses it.
  struct Passing {
    Entry entry;
    UploadQueue::Moment free;
  };

  const Entry& full_size(std::size_t view);

  Context& context_;
  std::size_t budget_;
  std::size_t cached_ = 0;
  std::vector<Entry> entries_;
  std::array<Passing, 2> passing_;  // in turns, so that one can come while the other is used
  std::size_t turn_ = 0;
  bool passing_used_ = false;  // by the last step, the one of this turn
  std::optional<UploadQueue> uploads_;
  // What does not count of a photo.
  struct LeftOut {
    int width = 0;
    int height = 0;
    Buffer<std::uint32_t> words;
  };
  std::vector<LeftOut> left_out_;  // of all views, once one has some
  bool cut_out_ = false;
  Buffer<std::uint32_t> reduced_, masked_;
  Kernel reduce_, mask_;
  io::ViewLoader loader_;
};

}  // namespace raysplats
