// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/trace_options.hpp"

namespace raysplats::io {

/// Header lines of a PLY, "comment raysplats KEY VALUE" each, with the options that change what a
/// model shows. read_ply_options() reads them back to the bit.
std::string ply_option_comments(const TraceOptions& options);

}  // namespace raysplats::io
