// SPDX-License-Identifier: Apache-2.0
#include "render_output.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "raysplats/error.hpp"
#include "render/output_check.hpp"
#include "util/output_directory.hpp"

namespace raysplats::cli {
namespace {

constexpr double kFps = 30.0;

}  // namespace

FrameOptions RenderFlags::frame_options() const {
  FrameOptions out;
  if (format == "exr") out.format = FrameFormat::kExr;
  if (format == "jpg") out.format = FrameFormat::kJpg;
  if (!exr.empty() && format != "exr") {
    throw UsageError(fmt::format("--exr {} is for --format exr, not {}", exr, format));
  }
  out.linear_exr = exr != "display";
  out.supersample = supersample;
  out.depth = depth;
  out.normals = normals;
  out.hits = hits;
  out.files = !output.empty();
  if (output.empty() && video.empty())
    throw UsageError("There is nowhere to put the frames: give -o DIR, --video FILE or both");
  if (output.empty() && (depth || normals || hits)) {
    throw UsageError(
        "--depth, --normals and --hits are for the files of frames: add -o DIR to --video");
  }
  if (fps && path.empty() && video.empty())
    throw UsageError("--fps is for --path and --video: files of frames have no time");
  if (shutter && !shutter_samples)
    throw UsageError("--shutter is for motion blur: add --shutter-samples N");
  out.shutter = shutter.value_or(out.shutter);
  out.shutter_samples = shutter_samples.value_or(1);
  return out;
}

void RenderFlags::check_path_options() const {
  if (!path_data.empty() && path_transform.empty())
    throw UsageError("--path-data is about nerfstudio's scaled world: add --path-transform FILE");
  if (!path.empty()) return;
  if (!path_transform.empty() || constant_speed) {
    throw UsageError("--path-transform and --constant-speed shape a camera path: add --path FILE");
  }
  if (seconds && video.empty())
    throw UsageError("--seconds is for --path and --video: files of frames have no time");
  if (seconds && fps) {
    throw UsageError(
        "The frames are so many as are asked for, so --seconds says how fast they go, or --fps: "
        "give one");
  }
}

CameraPathFile read_path(const RenderFlags& flags) {
  PathOptions options;
  options.seconds = flags.seconds;
  options.fps = flags.fps;
  options.width = flags.width;
  options.height = flags.height;
  options.constant_speed = flags.constant_speed;
  options.transform = flags.path_transform;
  options.data_transform = flags.path_data;
  return read_camera_path(flags.path, options);
}

RenderOutput::RenderOutput(const RenderFlags& flags,
                           std::span<const Camera> cameras,
                           std::size_t frames,
                           std::optional<double> fps,
                           bool closed)
    : flags_(flags), options_(flags.frame_options()) {
  options_.closed = closed;
  if (options_.files) {
    if (!flags.data.data.empty()) check_not_data(flags.output, flags.data.data);
    if (!flags.cameras.empty()) check_not_data(flags.output, flags.cameras);
    check_leftovers(flags.output, frame_names(cameras), options_.format, flags.overwrite);
  }
  if (flags.video.empty()) return;
  std::error_code error;
  if (!flags.overwrite && std::filesystem::exists(flags.video, error)) {
    throw UsageError(
        fmt::format("{} is there already: give another name, or --overwrite", flags.video));
  }
  for (const Camera& camera : cameras) {
    if (camera.width == cameras.front().width && camera.height == cameras.front().height) continue;
    throw UsageError(fmt::format(
        "--video needs frames of one size, and the cameras have {} x {} and {} x {} pixels",
        cameras.front().width, cameras.front().height, camera.width, camera.height));
  }
  double rate = flags.fps.value_or(fps.value_or(kFps));
  // A path has made its frames of the seconds; all other cameras go by in them.
  if (flags.seconds && flags.path.empty()) {
    rate = static_cast<double>(frames) / *flags.seconds;
    if (rate < kLeastFps || rate > kMostFps) {
      throw UsageError(
          fmt::format("{} frames in {} s are {:.6g} a second, not {} to {}: give other seconds",
                      frames, *flags.seconds, rate, kLeastFps, kMostFps));
    }
  }
  video_ = open_video(flags.video, {rate, frames});
  options_.video = video_.get();
}

void RenderOutput::begin() const {
  if (options_.files) make_output_directory(flags_.output);
}

void RenderOutput::finish() {
  if (video_) video_->finish();
}

std::string RenderOutput::name() const {
  if (flags_.video.empty()) return flags_.output;
  if (flags_.output.empty()) return flags_.video;
  return fmt::format("{} and {}", flags_.output, flags_.video);
}

}  // namespace raysplats::cli
