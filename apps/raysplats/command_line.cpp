// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <limits>
#include <span>
#include <utility>

#include "raysplats/train_options.hpp"
#include "run/train_option_table.hpp"
#include "util/nearest_name.hpp"
#include "util/number_text.hpp"
#include "util/shell_word.hpp"

namespace raysplats::cli {
namespace {

constexpr std::size_t kAnyNumber = std::numeric_limits<std::size_t>::max();

/// How many numbers the list of an option has at most, which shells cut into words at its spaces; 0
/// for options that take no list.
std::size_t most_numbers(std::string_view name) {
  if (name == "--background" || name == "--up") return 3;
  if (name == "--crop" || name == "--bounds") return 6;
  if (name == "--sizes") return kAnyNumber;
  TrainOptions options;
  const std::vector<OptionRow> keys = train_option_rows(options);
  const bool list =
      name.starts_with("--") && std::any_of(keys.begin(), keys.end(), [&](const OptionRow& key) {
        return key.list == OptionRow::List::kNumbers && key.name == name.substr(2);
      });
  return list ? kAnyNumber : 0;
}

std::size_t count_numbers(std::string_view text) {
  constexpr std::string_view kBetween = "[],= ";
  std::size_t count = 0;
  for (std::size_t at = 0; (at = text.find_first_not_of(kBetween, at)) != std::string_view::npos;
       ++count) {
    at = std::min(text.find_first_of(kBetween, at), text.size());
  }
  return count;
}

/// How many of `words`, which follow an option, belong to its list, of which the option's own word
/// has `begun`. What follows a list that is full is no part of it.
std::size_t list_words(std::string_view option,
                       std::size_t begun,
                       std::span<const char* const> words) {
  const std::size_t most = most_numbers(option);
  std::size_t count = begun;
  std::size_t taken = 0;
  for (; most > 0 && taken < words.size() && is_number_list_part(words[taken]); ++taken) {
    const std::size_t more = count_numbers(words[taken]);
    if (more > 0 && count >= most) break;
    count += more;
  }
  // One number is a grey, and two are no colour.
  if (option == "--background" && count < most) taken = std::min<std::size_t>(taken, begun == 0);
  return taken;
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group().empty()) continue;
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  }
  return names;
}

// Without those that no help names.
std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (!command->get_group().empty()) names.push_back(command->get_name());
  }
  return names;
}

/// Where a list of any length may have taken the file or folder that is missing: says so.
std::string taken_as_number(const CLI::App& command, const CLI::ParseError& error) {
  // What is written is named by its option alone.
  if (error.get_name() != "RequiredError" || std::string_view(error.what()).starts_with("--output"))
    return "";
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& words : option->results()) {
      const std::size_t space = words.rfind(' ');
      const std::string name = option->get_name();
      if (space == std::string::npos || most_numbers(name) != kAnyNumber) continue;
      return fmt::format("; {1} is taken for a number of {0}: write ./{1} for a file or folder",
                         name, words.substr(space + 1));
    }
  }
  return "";
}

std::string unknown(const std::string& what, const std::string& nearest, const std::string& help) {
  return nearest.empty()
             ? fmt::format("Unknown {}: '{}' lists all", what, help)
             : fmt::format("Unknown {}: did you mean {}? '{}' lists all", what, nearest, help);
}

}  // namespace

std::string command_line(int argc, const char* const* argv) {
  std::string line = "raysplats";
  for (int i = 1; i < argc; ++i) line += " " + shell_word(argv[i]);
  return line;
}

std::vector<std::string> own_arguments(int argc, const char* const* argv) {
  // The names of 3DGS, gsplat, OpenSplat and nerfstudio for what every trainer needs.
  constexpr std::array<std::pair<std::string_view, std::string_view>, 9> kForeign{
      {{"--source_path", "--data"},
       {"--model_path", "--output"},
       {"--data_dir", "--data"},
       {"--result_dir", "--output"},
       {"--max_steps", "--iterations"},
       {"--data_factor", "--downscale"},
       {"--num-iters", "--iterations"},
       {"--max-num-iterations", "--iterations"},
       {"--output-dir", "--output"}}};
  std::vector<std::string> arguments;
  bool trains = false;  // elsewhere these names would mean other things: 3DGS renders a model_path
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    trains = trains || word == "train";
    const std::string_view name = std::string_view(word).substr(0, word.find('='));
    for (const auto& [foreign, own] : kForeign) {
      if (!trains || name != foreign) continue;
      word.replace(0, foreign.size(), own);
      break;
    }
    // One word for a list, so that what follows it is no part of it: --save-at 5 10 DATA.
    const std::string option = word.substr(0, word.find('='));
    const std::size_t begun = count_numbers(std::string_view(word).substr(option.size()));
    for (auto left = list_words(option, begun, {argv + i + 1, argv + argc}); left > 0; --left) {
      word += word.find('=') == std::string::npos ? '=' : ' ';
      word += argv[++i];
    }
    arguments.push_back(std::move(word));
  }
  return arguments;
}

std::string explain(const CLI::ParseError& error, const CLI::App& app) {
  const std::vector<CLI::App*> parsed = app.get_subcommands();
  const CLI::App& command = parsed.empty() ? app : *parsed.front();
  const std::string help =
      parsed.empty() ? "raysplats -h" : fmt::format("raysplats {} -h", command.get_name());
  // What was left over explains more than what is missing because of it.
  for (const std::string& text : app.remaining(true)) {
    if (text.size() > 1 && text.front() == '-') {
      const std::string name = text.substr(0, text.find('='));
      std::vector<std::string> known = option_names(command);
      for (std::string& global : option_names(app)) known.push_back(std::move(global));
      return unknown("option " + name, nearest_name(name, known), help);
    }
    if (parsed.empty()) {
      return unknown("command " + shell_word(text), nearest_name(text, command_names(app)), help);
    }
    return fmt::format("Unexpected argument '{}': '{}' shows what {} takes", text, help,
                       command.get_name());
  }
  if (parsed.empty() && error.get_name() == "RequiredError") {
    return fmt::format("No command given: use one of {}; 'raysplats -h' explains them",
                       fmt::join(command_names(app), ", "));
  }
  return fmt::format("{}{} ('{}' explains the options)", error.what(),
                     taken_as_number(command, error), help);
}

}  // namespace raysplats::cli
