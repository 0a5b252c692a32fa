// SPDX-License-Identifier: Apache-2.0
// A folder with photos, and stand-ins for COLMAP and FFmpeg that note how they were called.
#pragma once

#include <string>
#include <vector>

#include "program.hpp"

class Stage {
 public:
  /// photos/a.png, b.png and c.png, and a COLMAP that places a.png and b.png.
  Stage();
  /// An executable file.
  void write(const std::string& name, const std::string& text) const;
  std::string path(const std::string& name) const { return folder_ / name; }
  /// A COLMAP that knows these options of Sift* and Feature*.
  void write_newer_colmap(const std::string& options) const;
  /// walk.mp4, an FFmpeg that takes three frames of it, and an ffprobe that says `length`, `stream`
  /// and, of the packets, `packets`.
  void write_video(const std::string& length,
                   const std::string& packets,
                   const std::string& stream = "avg_frame_rate=0/0\\n") const;

  /// Runs `prepare`. `fail`: the command of COLMAP that fails, "no model", or "full" and the
  /// command whose database finds a full disk.
  Outcome run(const Words& arguments, const std::string& fail = "") const;
  /// What COLMAP and FFmpeg were called with since the last time.
  std::string calls() const;

 private:
  TemporaryFolder folder_;
};
