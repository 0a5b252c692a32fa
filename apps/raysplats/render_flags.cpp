// SPDX-License-Identifier: Apache-2.0
#include "render_flags.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "util/number_text.hpp"
#include "validators.hpp"

namespace raysplats::cli {
namespace {

void add_output_options(CLI::App& command, RenderFlags& options) {
  command.add_option("-o,--output", options.output, "Folder for the frames")
      ->check(not_empty())
      ->type_name("DIR");
  command
      .add_option("--video", options.video,
                  "All frames as one file: .mp4 or .webm (by ffmpeg), .gif or .apng")
      ->check(not_empty())
      ->type_name("FILE");
  add_overwrite_flag(command, options.overwrite,
                     "Also into a folder that holds results of something else, and over a video");
  command.add_option("--format", options.format, "exr (float RGBA), png or jpg (8-bit RGB)")
      ->check(one_of({"exr", "png", "jpg"}))
      ->capture_default_str();
  command
      .add_option("--exr", options.exr,
                  "Numbers of an EXR: linear (default), as other programs expect, or display, the "
                  "values as trained that PNG and JPG hold")
      ->check(one_of({"linear", "display"}));
}

void add_camera_options(CLI::App& command, RenderFlags& options) {
  const std::string where = "Other cameras";
  command.add_option("--cameras", options.cameras, "transforms.json or cameras.json with cameras")
      ->group(where)
      ->type_name("FILE");
  command
      .add_option(
          "--orbit", options.orbit,
          "N cameras on a circle around the model (with --data, and of a run: as its cameras)")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");

  command
      .add_option("--path", options.path,
                  "Camera path: JSON of nerfstudio or the viewer's page, or keyframes in TOML")
      ->group(where)
      ->type_name("FILE");
  command
      .add_option("--ellipse", options.ellipse,
                  "N cameras on the ellipse along which --data's photos lie")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");
  command.add_option("--spiral", options.spiral, "N cameras on a spiral about --data's mean photo")
      ->group(where)
      ->transform(whole_between(1, 1e6))
      ->type_name("N");
  command
      .add_option("--interpolate", options.interpolate,
                  "From photo to photo of --data, N frames each")
      ->group(where)
      ->transform(whole_between(1, 1e4))
      ->type_name("N");
}

void add_time_options(CLI::App& command, RenderFlags& options) {
  const std::string time = "Time";
  command
      .add_option("--seconds", options.seconds,
                  "Of --path (the file's), or in which all frames of --video go by")
      ->group(time)
      ->transform(between(1e-3, 86400));
  command
      .add_option("--fps", options.fps, "Frames a second of --path and --video (the file's, or 30)")
      ->group(time)
      ->transform(between(kLeastFps, kMostFps));
  command
      .add_flag("--constant-speed", options.constant_speed,
                "The eye of --path moves at one speed, whatever the file says of seconds")
      ->group(time);
  command
      .add_option("--path-transform", options.path_transform,
                  "dataparser_transforms.json of nerfstudio, for paths in its scaled world")
      ->group(time)
      ->type_name("FILE");
  command
      .add_option("--path-data", options.path_data,
                  "With it, the transforms.json that the model was trained from, where that has "
                  "an applied_transform")
      ->group(time)
      ->type_name("FILE");
  command
      .add_option("--shutter-samples", options.shutter_samples,
                  "Motion blur: moments of every frame that are averaged")
      ->group(time)
      ->transform(whole_between(1, 1024))
      ->type_name("N");
  command
      .add_option("--shutter", options.shutter,
                  "Share of the time to the next frame in which they lie (0.5)")
      ->group(time)
      ->transform(between(1e-3, 1));
}

void add_orbit_options(CLI::App& command, RenderFlags& options) {
  const std::string orbit = "Orbit";
  command
      .add_option("--width", options.width,
                  "Pixels (800, or the photos'; one side alone keeps the shape)")
      ->group(orbit)
      ->transform(whole_between(1, kMaxSide));
  command.add_option("--height", options.height, "Pixels")
      ->group(orbit)
      ->transform(whole_between(1, kMaxSide));
  command.add_option("--fov", options.fov, "Degrees along the smaller side (45, or the photos')")
      ->group(orbit)
      ->transform(between(kLeastFov, most_fov(CameraModel::kFisheye)));
  command
      .add_option("--elevation", options.elevation,
                  "Degrees above the centre (20, or the cameras' median)")
      ->group(orbit)
      ->transform(between(-89.9, 89.9));
  command
      .add_option("--distance", options.distance,
                  "Of the eye from the centre (the model fits, or the cameras' median)")
      ->group(orbit)
      ->transform(between(1e-9, kNoBound));
  command
      .add_option("--camera-model", options.camera_model,
                  "pinhole, fisheye, equirectangular (twice as wide as high) or orthographic")
      ->group(orbit)
      ->check(one_of({"pinhole", "fisheye", "equirectangular", "orthographic"}));
  command.add_option("--up", options.up, "World direction that is up (0,-1,0, or the cameras')")
      ->group(orbit)
      ->check(triple())
      ->type_name("X,Y,Z");
}

void add_scene_options(CLI::App& command, RenderFlags& options) {
  const std::string scene = "Scene files (over what they say)";
  add_render_flags(command, options.render, scene);
  command
      .add_option("--frames", options.frames,
                  "Only the frames from START up to END, which is left out; either may be empty")
      ->group(scene)
      ->type_name("START:END");
}

void add_layer_options(CLI::App& command, RenderFlags& options) {
  command.add_option("--supersample", options.supersample, "S x S rays per pixel, averaged")
      ->transform(whole_between(1, 16));
  command.add_flag("--depth", options.depth,
                   "Also expected depth: channel Z of an EXR, or NAME_depth.png");
  command.add_flag("--normals", options.normals,
                   "Also normals: channels N.X, N.Y, N.Z of an EXR in world axes, or "
                   "NAME_normals.png in the camera's (right red, up green, near blue)");
  command.add_flag("--hits", options.hits,
                   "Also the number of blended Gaussians: channel hits of an EXR, or "
                   "NAME_hits.png (white: the most of the frame)");
}

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

void add_render_options(CLI::App& command, RenderFlags& options) {
  add_output_options(command, options);
  add_data_flags(command, options.data);
  add_camera_options(command, options);
  add_time_options(command, options);
  add_orbit_options(command, options);
  add_scene_options(command, options);
  add_layer_options(command, options);
  add_trace_flags(command, options.trace);
  add_traversal_flag(command, options.trace);
  add_device_flags(command, options.device);
}

}  // namespace raysplats::cli
