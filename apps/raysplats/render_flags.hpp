// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "options.hpp"
#include "render/frame_writer.hpp"
#include "scene/options/render_option_table.hpp"

namespace raysplats::cli {

/// Frames a second.
constexpr double kLeastFps = 1e-3, kMostFps = 1000;

/// Options of the command `render`, as given.
struct RenderFlags {
  std::string model;
  DataFlags data;
  std::string cameras;
  std::optional<int> orbit;
  std::string path;
  std::string path_transform;
  std::string path_data;
  std::optional<double> seconds;
  std::optional<double> fps;
  bool constant_speed = false;
  std::optional<int> ellipse;
  std::optional<int> spiral;
  std::optional<int> interpolate;
  std::string output;
  std::string video;
  std::optional<double> shutter;
  std::optional<int> shutter_samples;
  bool overwrite = false;
  std::string format = "png";
  std::string exr;  ///< "linear", "display" or "" = not given
  int supersample = 1;
  bool depth = false;
  bool normals = false;
  bool hits = false;
  std::optional<int> width;
  std::optional<int> height;
  std::optional<double> fov;
  std::optional<double> elevation;
  std::optional<double> distance;
  std::optional<std::string> up;
  std::optional<std::string> camera_model;
  GivenRenderSettings render;
  std::string frames;
  TraceSettings trace;
  DeviceFlags device;

  /// Throws UsageError for options that do not go with the format.
  FrameOptions frame_options() const;
  /// Throws UsageError for those of a camera path without one.
  void check_path_options() const;
};

/// All options of `render` but its first argument.
void add_render_options(CLI::App& command, RenderFlags& options);

/// `render` of a scene file.
void render_scene(const RenderFlags& flags, const GlobalOptions& global);

}  // namespace raysplats::cli
