// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <memory>
#include <span>
#include <string>

#include "comm/communicator.hpp"
#include "io/scene/camera_path_file.hpp"
#include "render_flags.hpp"

namespace raysplats::cli {

/// The path of --path with what the command line says over it. Throws UsageError where options
/// would do nothing.
CameraPathFile read_path(const RenderFlags& flags);

/// Where the frames of `render` go: a folder, a video, or both. Whatever cannot be is refused
/// before anything is traced.
class RenderOutput {
 public:
  /// `fps` and `closed` as the cameras say.
  RenderOutput(const RenderFlags& flags,
               std::span<const Camera> cameras,
               std::size_t frames,
               std::optional<double> fps,
               bool closed);

  const FrameOptions& options() const { return options_; }
  /// Makes the folder and begins the video. Throws UsageError for a video that several ranks would
  /// write. Whoever calls it holds an InterruptGuard: a file that is begun is left behind where a
  /// signal ends the process.
  void begin(const Communicator& ranks);
  /// Completes the video.
  void finish();
  /// "DIR", "VIDEO" or "DIR and VIDEO".
  std::string name() const;
  /// The end of a sentence about an interrupted rendering: "frames: what is in DIR is whole".
  std::string left() const;

 private:
  const RenderFlags& flags_;
  FrameOptions options_;
  VideoOptions pace_;
  std::unique_ptr<VideoFile> video_;
};

}  // namespace raysplats::cli
