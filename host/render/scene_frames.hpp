// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>

#include "io/scene/scene_loader.hpp"
#include "raysplats/path_tracer.hpp"
#include "render/frame_writer.hpp"

namespace raysplats {

struct SceneReport {
  std::size_t frames = 0;
  PathTracer::Statistics rays;  ///< of all frames
  double trace_seconds = 0;     ///< placing meshes, tracing and download, without the files
};

/// Draws the frames from `first` up to but without `last` and writes them to `folder`, which
/// exists, named as their cameras (frame_names()). Depth, normals and hits are those of the rays
/// through the pixels' middles (PathTracer::first_hits()), however many samples there are, at the
/// first of the shutter's moments. `done` hears the number of finished frames and returns false to
/// stop early; so does `within` with the share of the frame that is being drawn, which is not
/// written then. Throws what the tracer throws, UsageError for shutters out of range, DataError
/// when a file fails.
SceneReport write_scene_frames(PathTracer& tracer,
                               const LoadedScene& scene,
                               std::size_t first,
                               std::size_t last,
                               const std::filesystem::path& folder,
                               const FrameOptions& options,
                               const std::function<bool(std::size_t)>& done = {},
                               const std::function<bool(double)>& within = {});

}  // namespace raysplats
