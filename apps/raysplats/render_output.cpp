// SPDX-License-Identifier: Apache-2.0
#include "render_output.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string>
#include <vector>

#include "io/image/side_limits.hpp"
#include "raysplats/error.hpp"
#include "render/output_check.hpp"
#include "util/atomic_file.hpp"
#include "util/output_directory.hpp"

namespace raysplats::cli {
namespace {

constexpr double kFps = 30.0;

}  // namespace

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
    if (!flags.overwrite) check_outside_data(flags.output);
    const std::vector<std::string> names = frame_names(cameras);
    const std::string extension = file_extension(options_.format);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      io::require_writable_size(std::filesystem::path(flags.output) / (names[i] + extension),
                                cameras[i].width, cameras[i].height);
    }
    check_leftovers(flags.output, names, options_.format, flags.overwrite);
  }
  if (flags.video.empty()) return;
  check_output_file(flags.video, flags.overwrite);
  for (const Camera& camera : cameras) {
    io::require_writable_size(flags.video, camera.width, camera.height);
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
  pace_ = {rate, frames};
  open_video(flags.video, pace_);  // which refuses what cannot be written
}

void RenderOutput::begin(const Communicator& ranks) {
  if (ranks.size() > 1 && !flags_.video.empty()) {
    throw UsageError(
        "--video is written by one rank, frame after frame: leave out mpirun and the list of "
        "--device, or write the frames alone");
  }
  if (options_.files) make_output_directory(flags_.output);
  if (flags_.video.empty()) return;
  video_ = open_video(flags_.video, pace_);
  options_.video = video_.get();
}

void RenderOutput::finish() {
  if (video_) video_->finish();
}

std::string RenderOutput::name() const {
  if (flags_.video.empty()) return flags_.output;
  if (flags_.output.empty()) return flags_.video;
  return fmt::format("{} and {}", flags_.output, flags_.video);
}

std::string RenderOutput::left() const {
  if (flags_.output.empty()) return "frames: no video was written";
  return fmt::format("frames: what is in {} is whole{}", flags_.output,
                     flags_.video.empty() ? "" : ", and no video was written");
}

}  // namespace raysplats::cli
