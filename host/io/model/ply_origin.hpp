// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>

#include "io/ply_file.hpp"

namespace raysplats::io {

/// Whether the header of a PLY names doubles but no origin: positions then count from
/// origin_of_doubles(). Throws DataError for an origin that is no three numbers.
bool lacks_origin(const std::filesystem::path& path);

/// What is taken off positions that are doubles as a model of Gaussians is read, so that floats
/// tell them apart: an origin near their median where they lie so far away that rounding would move
/// them against each other by a part of their sizes; 0 for all others and for positions in floats.
std::array<double, 3> origin_of_doubles(const PlyFile& file);

}  // namespace raysplats::io
