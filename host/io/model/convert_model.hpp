// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>

#include "raysplats/io.hpp"
#include "raysplats/model_changes.hpp"

namespace raysplats {

/// What a conversion did.
struct Conversion {
  std::size_t read = 0, written = 0;  ///< Gaussians
  int sh_degree = 0;                  ///< of what was written, before the format's losses
  std::string losses;                 ///< as io::losses(), and what the file does not say
};

/// Reads `input` with the encoding, changes it and writes `output`; of `trace` the sky turns with
/// it and the near depth scales. Coordinates are those of the data: what the file holds plus its
/// origin (read_ply_origin()), which scales, turns and moves with them. A translation goes into the
/// origin and leaves the numbers alone, but where single precision holds positions without an
/// origin, which takes it away, and where there was none and `output` cannot say one. Throws as
/// read_model(), changed() and write_model(), and UsageError when both are the same file, when
/// `output` is there without `overwrite`, when nothing is left to write, and for a near depth
/// beyond single precision.
Conversion convert_model(const std::filesystem::path& input,
                         const std::filesystem::path& output,
                         const ModelChanges& changes,
                         const ModelEncoding& encoding,
                         std::optional<TraceOptions> trace,
                         bool overwrite);

}  // namespace raysplats
