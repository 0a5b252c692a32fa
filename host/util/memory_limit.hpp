// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats {

/// "; this process may take 585 MiB of memory (ulimit -v)" for the end of a sentence about memory
/// or about a library that cannot be loaded; empty where nothing bounds the process.
std::string memory_limit_remark();

}  // namespace raysplats
