// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

#include "core/gaussian_selection.hpp"
#include "raysplats/io.hpp"

namespace raysplats {

/// What is changed between reading and writing, in this order; in the coordinates of the file,
/// whose origin (read_ply_origin()) stays.
struct ModelChanges {
  std::optional<double> min_opacity;
  std::optional<glm::dvec3> up;  ///< this direction becomes up, the -y of model files
  double scale = 1.0;
  glm::dvec3 rotate_degrees{0.0};  ///< about the axes x, then y, then z
  glm::dvec3 translate{0.0};
  std::optional<CropBox> crop;               ///< in the coordinates of the result
  std::optional<std::size_t> max_gaussians;  ///< those that most_contributing() keeps
  std::optional<int> sh_degree;
};

/// Throws UsageError for an `up` of length 0.
Gaussians changed(const Gaussians& model, const ModelChanges& changes);

/// What a conversion did.
struct Conversion {
  std::size_t read = 0, written = 0;  ///< Gaussians
  int sh_degree = 0;                  ///< of what was written, before the format's losses
  std::string losses;                 ///< as io::losses()
};

/// Reads `input` with the encoding, changes it and writes `output`; a sky in `trace` turns with it.
/// Throws as read_model() and
/// write_model(), and UsageError when both are the same file, when `output` is there without
/// `overwrite`, and when nothing is left to write.
Conversion convert_model(const std::filesystem::path& input,
                         const std::filesystem::path& output,
                         const ModelChanges& changes,
                         const ModelEncoding& encoding,
                         std::optional<TraceOptions> trace,
                         bool overwrite);

}  // namespace raysplats
