// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/camera.hpp"
#include "run/model_source.hpp"

namespace raysplats {

/// The cameras that a run's model was trained from, in the model's coordinates: those of
/// RUN/cameras.json (io::read_camera_list()). None for models that are in no run and runs without
/// that file. Throws DataError for a damaged one.
std::vector<Camera> run_cameras(const ModelSource& source);

/// The same, but none of a damaged file: a warning says that `asker` ("the page") has none.
std::vector<Camera> readable_run_cameras(const ModelSource& source, const char* asker);

}  // namespace raysplats
