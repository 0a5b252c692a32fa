// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>

#include "raysplats/trace_options.hpp"

namespace raysplats::io {

/// Header lines of a PLY, "comment raysplats KEY VALUE" each, with the options that change what a
/// model shows. read_ply_options() reads them back to the bit.
std::string ply_option_comments(const TraceOptions& options);
/// The line with the origin; nothing for 0. read_ply_origin() reads it back to the bit.
std::string ply_origin_comment(const std::array<double, 3>& origin);

/// The options of `render` that are needed for a model which shows as `shown` says where its file
/// does not say it, as in "--hit-order entry --background 1,1,1"; "" where none is.
std::string flags_to_show(const TraceOptions& shown);

}  // namespace raysplats::io
