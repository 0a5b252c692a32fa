// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

#include "base/interrupt.hpp"
#include "base/progress.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

/// Draws how far frames are and lets signals end them: what write_frames() and
/// write_scene_frames() tell.
class FrameProgress {
 public:
  FrameProgress(std::size_t frames, bool quiet)
      : total_(frames),
        progress_("rendering", static_cast<std::int64_t>(frames), 0, quiet ? nullptr : stderr) {}

  /// A frame is done. False = stop.
  bool done(std::size_t frames) {
    frames_ = frames;
    progress_.update(static_cast<std::int64_t>(frames), "");
    return !interrupt_.requested();
  }
  /// A share of the frame in work is done. False = stop.
  bool within(double share) {
    progress_.update(static_cast<std::int64_t>(frames_),
                     fmt::format("{:.0f} % of this frame", 100.0 * share));
    return !interrupt_.requested();
  }
  /// Throws Error (kInterrupted) when a signal has ended it after `written` frames in `folder`.
  void finish(std::size_t written, const std::string& folder) {
    progress_.finish();
    if (!interrupt_.requested()) return;
    throw Error(ErrorCode::kInterrupted,
                fmt::format("Interrupted after {} of {} frames: what is in {} is whole", written,
                            total_, folder));
  }

 private:
  std::size_t total_;
  InterruptGuard interrupt_;
  Progress progress_;
  std::size_t frames_ = 0;
};

}  // namespace raysplats
