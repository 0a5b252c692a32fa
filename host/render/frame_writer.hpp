// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "io/image/video_file.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/model.hpp"
#include "raysplats/tracer.hpp"
#include "util/background_tasks.hpp"

namespace raysplats {

class Communicator;

enum class FrameFormat {
  kExr,  ///< float R, G, B (background blended), A = 1 - T, and Z with depth; see linear_exr
  kPng,  ///< 8-bit RGB, values as trained
  kJpg,
};

/// ".png" and the like.
std::string file_extension(FrameFormat format);

struct FrameOptions {
  FrameFormat format = FrameFormat::kPng;
  int supersample = 1;  ///< rays per pixel side; the samples are box-averaged
  bool depth =
      false;  ///< EXR: channel Z; PNG and JPG: a file NAME_depth.png, near white, far black
  bool normals = false;  ///< EXR: channels N.X, N.Y and N.Z, of length 1 or 0, in world axes; PNG
                         ///< and JPG: a file NAME_normals.png (normals_preview())
  bool hits = false;     ///< EXR: channel hits; PNG and JPG: a file NAME_hits.png (hits_preview())
  bool linear_exr = true;  ///< EXR: proportional to light, as other programs expect; false = the
                           ///< values as trained, which PNG and JPG hold
  bool files = true;       ///< one for every frame, as above
  VideoFile* video = nullptr;  ///< takes every frame as well
  int shutter_samples = 1;     ///< moments of a frame that are averaged (motion blur)
  double shutter = 0.5;        ///< share of the time to the next frame that they are taken in
  bool closed = false;         ///< the frame after the last one is the first
  /// Only every stride-th frame from this one on: what is left to a rank that shares the frames.
  std::size_t offset = 0, stride = 1;
  /// Of the library itself; its type is not installed. With it every rank calls write_frames() or
  /// write_scene_frames(), all draw every frame together, a band of rows each, and the rank that
  /// leads writes it.
  Communicator* bands = nullptr;
};

struct FrameReport {
  std::size_t frames = 0;
  std::uint64_t rays = 0;            ///< through pixels
  std::uint64_t reflected_rays = 0;  ///< by mirrors
  std::uint64_t capped_rays = 0;     ///< rays of both that stopped because of max_hits
  double trace_seconds = 0;          ///< tracing and download, without files and compiling kernels
};

/// One file name without extension and folder per camera: the stem of the image name; where stems
/// collide the folders join in ("left_0001"), and a number where that collides too. A camera
/// without a name is frame_%04d.
std::vector<std::string> frame_names(std::span<const Camera> cameras);

/// What a frame has beside its colours, at its size; empty pictures where options do not ask.
struct FrameLayers {
  Image depth;    ///< expected, 1 channel
  Image normals;  ///< 3 channels, world axes, of length 1 or 0
  Image hits;     ///< blended Gaussians, 1 channel; means where several rays make a pixel
  Image alpha;    ///< for previews, in the last channel; of the colours where empty
};

/// Takes finished frames while the next ones are traced: several are written at once, as
/// compressing a picture takes a processor as long as tracing it takes all of them, or longer.
class FrameWriter {
 public:
  /// `folder` exists where options.files says that there are files; both outlive the writer.
  FrameWriter(const std::filesystem::path& folder, const FrameOptions& options)
      : folder_(folder), options_(options) {}

  /// Gives a frame to options.video, and where options.files says so writes it: `name` with the
  /// format's extension, RGB of `rgba` for 8-bit formats, and the layers that options ask for.
  /// `camera` is the frame's. Throws DataError when a file of this or of an earlier frame fails.
  void add(const std::string& name, Image rgba, const Camera& camera, FrameLayers layers);
  /// Waits for all files. Throws DataError when one fails.
  void finish() { files_.finish(); }

 private:
  const std::filesystem::path& folder_;
  const FrameOptions& options_;
  BackgroundTasks files_;
};

/// Traces every camera and writes its files to `folder`, which exists where there are files. `done`
/// hears the number of finished frames and returns false to stop early; so does `within` with the
/// share of the frame that is being traced, which is not written then. The tracer was made with the
/// option depth when options.depth or options.hits is set; depth and hits are means over the
/// moments of the shutter, depth by alpha, and normals are those of the last one. Throws UsageError
/// for a supersampling factor outside 1..16 and shutters out of range, DataError when a file fails.
FrameReport write_frames(Tracer& tracer,
                         const Model& model,
                         std::span<const Camera> cameras,
                         const std::filesystem::path& folder,
                         const FrameOptions& options,
                         const std::function<bool(std::size_t)>& done = {},
                         const std::function<bool(double)>& within = {});

}  // namespace raysplats
