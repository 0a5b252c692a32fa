// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace raysplats::cli {

/// The program and its arguments as a shell takes them.
std::string command_line(int argc, const char* const* argv);
/// The arguments without the program's name; names that other trainers use for the same become
/// ours.
std::vector<std::string> own_arguments(int argc, const char* const* argv);

/// One sentence for a command line that does not parse, with the nearest known command or option.
std::string explain(const CLI::ParseError& error, const CLI::App& app);

}  // namespace raysplats::cli
