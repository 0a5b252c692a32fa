// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>

#include "raysplats/image.hpp"

namespace raysplats {

/// A video that is written frame by frame. The file appears when finish() has ended; without it
/// what was there before stays.
class VideoFile {
 public:
  virtual ~VideoFile() = default;
  /// RGB of values in [0, 1] as trained (3 channels or more); all frames have one size. Throws
  /// UsageError for another one and for more pixels a side than the format has, DataError when the
  /// file cannot be written, Error with what the encoder said when that fails.
  virtual void add(const Image& frame) = 0;
  virtual void finish() = 0;
};

/// Fewest frames a second of an animated PNG: one stays for 65535 ms at most.
constexpr double kLeastApngFps = 1000.0 / UINT16_MAX;

struct VideoOptions {
  double fps = 30.0;
  std::size_t frames = 0;  ///< that will be added
};

/// By the name's extension: .mp4 (H.264) and .webm (VP9) by the program ffmpeg found in PATH, .gif
/// (256 colours, up to 50 frames a second, which begin on whole 1/100 s) and .apng (without losses)
/// without it. Throws UsageError for other names, for frames per second that the format does not
/// have, and when ffmpeg is needed and not there.
std::unique_ptr<VideoFile> open_video(const std::filesystem::path& path,
                                      const VideoOptions& options);

/// The frames of an animated PNG as they were added, 8 bits a channel; one byte after the other.
std::unique_ptr<VideoFile> open_apng(const std::filesystem::path& path,
                                     const VideoOptions& options);

}  // namespace raysplats
