// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "io/scene/scene_file.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/trace_options.hpp"
#include "raysplats/train_options.hpp"

namespace raysplats {

/// A model on disk and the options it was trained with.
struct ModelSource {
  std::filesystem::path file;
  std::optional<TrainOptions>
      trained;                   ///< of the run folder it is in; none for a PLY from elsewhere
  std::filesystem::path config;  ///< that says so, where one does
  std::optional<TraceOptions> header;     ///< what the header of a PLY says
  SkyLight sky;                           ///< that the header of a PLY names
  std::optional<std::int64_t> iteration;  ///< of RUN/point_cloud/iteration_N
  std::array<double, 3> origin{};         ///< from which its positions count (Dataset::origin)
};

/// Whether `path` is the folder of a training run.
bool is_run_folder(const std::filesystem::path& path);

/// Whether it is a folder that find_model() looks into: of a run, or an unpacked SOG.
bool is_model_folder(const std::filesystem::path& path);

/// Names of a few files in a folder that are models by their extension, sorted.
std::vector<std::string> models_in(const std::filesystem::path& folder);

/// Finds the newest RUN/point_cloud/iteration_N/point_cloud.ply of a run folder, and the meta.json
/// of an unpacked SOG; a file is taken as it is, and when it lies in a run folder at that depth,
/// that run's configuration comes with it. Throws DataError when there is nothing to load,
/// UsageError when the run's configuration is broken.
ModelSource find_model(const std::filesystem::path& path);

/// The image size and the held-out views of the model's training, the defaults when nothing is
/// known; positions count from the model's origin.
DatasetOptions dataset_options(const ModelSource& source);

/// What a model has to be traced with to look as in training: the run's configuration tells, and
/// its background the header of the PLY; without a run that header tells all. Models of other
/// programs, which rasterise, are shown right in peak order and where they reach 1/255: that is
/// taken, and said, when nothing is known.
TraceOptions trace_options(const ModelSource& source);

/// Replaces run folders among a scene's models by their newest PLY, and makes the options of the
/// first model that tells them what the scene's [trace] and the data sets of its [camera] go over.
/// The scene counts from that model's origin; others that have one get their offset from there.
/// Throws as find_model().
void find_models(SceneFile& scene);

}  // namespace raysplats
