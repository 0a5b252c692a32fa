// SPDX-License-Identifier: Apache-2.0
#include "help.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

namespace raysplats::cli {
namespace {

/// What -h leaves out: choices of speed, and numbers whose defaults are good for nearly all.
constexpr std::array kRare{
    "profile",          "no-kernel-cache", "quantile",       "min-transmittance",
    "max-hits",         "packet-shape",    "packet-width",   "memory-budget",
    "launch-budget-ms", "traversal",       "undistort",      "ignore-areas",
    "test-every",       "test-list",       "path-transform", "path-data"};
/// What it shows of the hundred options of `train`.
constexpr std::array kTraining{
    "help",     "help-all",      "data",      "output",         "resume",   "time",
    "quality",  "overwrite",     "view",      "device",         "config",   "iterations",
    "seed",     "downscale",     "masks",     "alpha",          "borders",  "background",
    "mirror",   "bounds",        "sh-degree", "exposure",       "poses",    "hit-order",
    "strategy", "max-gaussians", "save-at",   "validate-views", "patience", "eval-at"};

template <std::size_t N>
bool named(const CLI::Option& option, const std::array<const char*, N>& names) {
  const std::vector<std::string>& own = option.get_lnames();
  return std::any_of(own.begin(), own.end(), [&](const std::string& name) {
    return std::find(names.begin(), names.end(), name) != names.end();
  });
}

}  // namespace

std::string HelpFormatter::make_help(const CLI::App* app,
                                     std::string name,
                                     CLI::AppFormatMode mode) const {
  whole_ = mode != CLI::AppFormatMode::Normal;
  train_ = app->get_name() == "train";
  left_out_ = 0;
  std::string out = CLI::Formatter::make_help(app, name, mode);
  if (left_out_ > 0) {
    while (out.ends_with("\n\n")) out.pop_back();
    out += fmt::format("\n{} more options: {} --help-all\n", left_out_, name);
  }
  whole_ = true;
  return out;
}

std::string HelpFormatter::make_group(std::string group,
                                      bool positional,
                                      std::vector<const CLI::Option*> options) const {
  if (!whole_ && !positional) {
    left_out_ += std::erase_if(options, [&](const CLI::Option* option) {
      return train_ ? !named(*option, kTraining) : named(*option, kRare);
    });
    if (options.empty()) return "";
  }
  return CLI::Formatter::make_group(std::move(group), positional, std::move(options));
}

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
