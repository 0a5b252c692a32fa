// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

namespace raysplats {

/// Every file below cl/ by its path there ("bvh/curve.cl"), embedded at build time.
const std::map<std::string, std::string>& kernel_sources();

/// The source of `path` with its `#include "..."` lines resolved from the embedded table (or from
/// `directory`, or RAYSPLATS_KERNEL_DIR when that is set), each file once, with #line marks.
std::string resolve_kernel_source(const std::string& path, const std::string& directory = "");

}  // namespace raysplats
