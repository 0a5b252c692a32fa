// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

namespace raysplats::test {

// Of the build that a test belongs to. Functions, not macros, so that what else a test consists of
// compiles to the same in every folder, and ccache keeps it.

/// The folder of the sources.
std::string source_dir();
/// The program `raysplats`.
std::string program_file();

}  // namespace raysplats::test
