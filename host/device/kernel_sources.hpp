// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>

namespace raysplats {

/// Every file below cl/ by its path there ("bvh/curve.cl"), embedded at build time.
const std::map<std::string, std::string>& kernel_sources();

/// The folder that kernels are read from: `directory`, or without one what RAYSPLATS_KERNEL_DIR
/// names; empty for the embedded ones.
std::string kernel_folder(const std::string& directory);

/// The source of `path` with its `#include "..."` lines resolved from kernel_folder() or the
/// embedded table, each file once, with #line marks.
std::string resolve_kernel_source(const std::string& path, const std::string& directory = "");

}  // namespace raysplats
