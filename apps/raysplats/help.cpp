// SPDX-License-Identifier: Apache-2.0
#include "help.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <vector>

namespace raysplats::cli {

std::string HelpFormatter::make_option_name(const CLI::Option* option, bool positional) const {
  if (positional) return option->get_name(true, false);
  std::vector<std::string> names;
  for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  return fmt::format("{}", fmt::join(names, ","));
}

std::string HelpFormatter::make_option_opts(const CLI::Option* option) const {
  std::string out;
  if (option->get_type_size() != 0 && !option->get_type_name().empty()) {
    out += " " + option->get_type_name();
  }
  if (!option->get_default_str().empty()) {
    out += fmt::format(" [default: {}]", option->get_default_str());
  }
  if (option->get_required()) out += " (required)";
  return out;
}

}  // namespace raysplats::cli
