// SPDX-License-Identifier: Apache-2.0
#include "build_paths.hpp"

namespace raysplats::test {

std::string source_dir() { return RAYSPLATS_SOURCE_DIR; }
std::string program_file() { return RAYSPLATS_PROGRAM; }

}  // namespace raysplats::test
