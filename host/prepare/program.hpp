// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// A program of somebody else, found in PATH. Throws UsageError that names the Debian package to
/// install when it is not there.
std::filesystem::path find_program(const std::string& name, const std::string& package);

/// Runs a program without a shell and waits for it. What it says (both streams) is appended to
/// `log`, and `line` hears every line. `stop` is asked several times a second and ends the program
/// by returning true. Throws Error(kInterrupted) then, and Error with the last lines and the name
/// of the log when the program fails.
void run_program(const std::filesystem::path& program,
                 const std::vector<std::string>& arguments,
                 const std::filesystem::path& log,
                 const std::function<void(std::string_view)>& line,
                 const std::function<bool()>& stop);

}  // namespace raysplats
