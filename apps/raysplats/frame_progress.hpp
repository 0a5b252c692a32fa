// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>

#include "comm/communicator.hpp"
#include "raysplats/error.hpp"
#include "util/interrupt.hpp"
#include "util/progress.hpp"

namespace raysplats::cli {

/// Draws how far a rank is with its share of the frames and lets signals end them: what
/// write_frames(), write_scene_frames() and evaluate() tell.
class FrameProgress {
 public:
  /// `work`: what the bar is called.
  FrameProgress(const std::string& work, std::size_t frames, const Communicator& ranks, bool quiet)
      : total_(frames),
        progress_(
            work,
            (static_cast<std::int64_t>(frames) + ranks.size() - 1 - ranks.rank()) / ranks.size(),
            0,
            quiet || !ranks.leads() ? nullptr : stderr) {}

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
  /// Throws Error (kInterrupted) when a signal has ended it after `frames` of all ranks; `rest`
  /// ends the sentence: "frames: what is in DIR is whole".
  void finish(std::size_t frames, const std::string& rest) {
    progress_.finish();
    if (!interrupt_.requested()) return;
    throw Error(ErrorCode::kInterrupted,
                fmt::format("Interrupted after {} of {} {}", frames, total_, rest));
  }

 private:
  std::size_t total_;
  InterruptGuard interrupt_{LostReader::kInterrupts};
  Progress progress_;
  std::size_t frames_ = 0;
};

}  // namespace raysplats::cli
