// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "command_tree.hpp"

namespace raysplats::cli {

/// Scripts that complete commands, options, their words and file names.
std::string bash_completion(const CommandEntry& program);
std::string zsh_completion(const CommandEntry& program);
std::string fish_completion(const CommandEntry& program);

/// The manual page of the program, or of one of its commands as `raysplats-COMMAND`, in roff (man
/// macros). `version` goes into its foot.
std::string manual_page(const CommandEntry& program, const std::string& version);
std::string manual_page(const CommandEntry& program,
                        const CommandEntry& command,
                        const std::string& version);

}  // namespace raysplats::cli
