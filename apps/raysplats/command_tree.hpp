// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace raysplats::cli {

/// An option as its help shows it.
struct OptionEntry {
  std::vector<std::string> names;    ///< "-o", "--output"; of arguments without a name "MODEL"
  std::string value;                 ///< "FILE"; empty for flags
  std::string text;                  ///< what it does
  std::string initial;               ///< default; may be empty
  std::vector<std::string> choices;  ///< of a value that is one of a few words
  bool argument = false;             ///< has no name on the command line
};

/// A command with those below it.
struct CommandEntry {
  std::string name;  ///< "train"; of the program itself "raysplats"
  std::string text;
  std::vector<OptionEntry> options;  ///< without those of the program
  std::vector<CommandEntry> commands;
};

/// Everything that can be said on the command line, in the order of the help. Commands of the group
/// "" are left out.
CommandEntry command_tree(const CLI::App& app);

}  // namespace raysplats::cli
