// SPDX-License-Identifier: Apache-2.0
#include "command_tree.hpp"

#include <sstream>

namespace raysplats::cli {
namespace {

/// The words of one_of(), which are its name.
std::vector<std::string> choices_of(CLI::Option& option) {
  for (int i = 0;; ++i) {
    CLI::Validator* validator = nullptr;
    try {
      validator = option.get_validator(i);
    } catch (const CLI::OptionNotFound&) {
      return {};
    }
    if (validator->get_name().find('|') == std::string::npos) continue;
    std::vector<std::string> words;
    std::istringstream stream(validator->get_name());
    for (std::string word; std::getline(stream, word, '|');) words.push_back(word);
    return words;
  }
}

OptionEntry entry_of(CLI::Option& option) {
  OptionEntry entry;
  for (const std::string& name : option.get_snames()) entry.names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) entry.names.push_back("--" + name);
  entry.argument = entry.names.empty();
  if (entry.argument) entry.names.push_back(option.get_name(true, false));
  if (option.get_items_expected_max() > 0) {
    entry.value = option.get_type_name().empty() ? "VALUE" : option.get_type_name();
  }
  entry.text = option.get_description();
  entry.initial = option.get_default_str();
  entry.choices = choices_of(option);
  return entry;
}

}  // namespace

CommandEntry command_tree(const CLI::App& app) {
  CommandEntry entry{app.get_name(), app.get_description(), {}, {}};
  for (const CLI::Option* option : app.get_options()) {
    // CLI11 hands out what it reads by pointers that may be written through.
    entry.options.push_back(entry_of(const_cast<CLI::Option&>(*option)));
  }
  for (const CLI::App* command : app.get_subcommands({})) {
    if (!command->get_group().empty()) entry.commands.push_back(command_tree(*command));
  }
  return entry;
}

}  // namespace raysplats::cli
