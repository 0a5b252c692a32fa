// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <CLI/CLI.hpp>
#include <cstddef>
#include <string>
#include <vector>

namespace raysplats::cli {

/// How -h shows an option: all its names, what it takes and its default, which can be pasted. -h
/// leaves out what few people need and says how many those are; --help-all shows them too.
class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app,
                        std::string name,
                        CLI::AppFormatMode mode) const override;
  std::string make_group(std::string group,
                         bool positional,
                         std::vector<const CLI::Option*> options) const override;
  std::string make_option_name(const CLI::Option* option, bool positional) const override;
  std::string make_option_opts(const CLI::Option* option) const override;

 private:
  // State of the help in work, whose parts CLI11 asks for one after the other.
  mutable bool whole_ = true;
  mutable bool train_ = false;
  mutable std::size_t left_out_ = 0;
};

}  // namespace raysplats::cli
