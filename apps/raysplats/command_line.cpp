// SPDX-License-Identifier: Apache-2.0
#include "command_line.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <utility>

#include "raysplats/train_options.hpp"
#include "run/train_option_table.hpp"
#include "util/nearest_name.hpp"
#include "util/number_text.hpp"

namespace raysplats::cli {
namespace {

/// Whether an option takes a list of numbers, which shells cut into words at its spaces.
bool takes_numbers(std::string_view name) {
  if (name == "--background" || name == "--up" || name == "--sizes" || name == "--crop")
    return true;
  TrainOptions options;
  const std::vector<OptionRow> keys = train_option_rows(options);
  return name.starts_with("--") && std::any_of(keys.begin(), keys.end(), [&](const OptionRow& key) {
           return key.list == OptionRow::List::kNumbers && key.name == name.substr(2);
         });
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

}  // namespace

std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

std::string command_line(int argc, const char* const* argv) {
  std::string line = "raysplats";
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool plain = !word.empty() && std::all_of(word.begin(), word.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 ||
             std::string_view("-_=./:,+@%").find(static_cast<char>(c)) != std::string_view::npos;
    });
    line += fmt::format(" {}", plain ? std::string(word) : shell_quoted(word));
  }
  return line;
}

std::vector<std::string> own_arguments(int argc, const char* const* argv) {
  // gsplat's and OpenSplat's names for what every trainer needs.
  constexpr std::array<std::pair<std::string_view, std::string_view>, 5> kForeign{
      {{"--data_dir", "--data"},
       {"--result_dir", "--output"},
       {"--max_steps", "--iterations"},
       {"--num-iters", "--iterations"},
       {"--data_factor", "--downscale"}}};
  std::vector<std::string> arguments;
  for (int i = 1; i < argc; ++i) {
    std::string word = argv[i];
    const std::string_view name = std::string_view(word).substr(0, word.find('='));
    for (const auto& [foreign, own] : kForeign) {
      if (name != foreign) continue;
      word.replace(0, foreign.size(), own);
      break;
    }
    // One word for a list, so that what follows it is no part of it: --save-at 5 10 DATA.
    const std::size_t mark = word.find('=');
    if (takes_numbers(std::string_view(word).substr(0, mark))) {
      for (; i + 1 < argc && is_number_list_part(argv[i + 1]); ++i) {
        word += word.find('=') == std::string::npos ? '=' : ' ';
        word += argv[i + 1];
      }
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
      return fmt::format("Unknown option {}: did you mean {}? '{}' lists all", name,
                         nearest_name(name, known), help);
    }
    if (parsed.empty()) {
      return fmt::format("Unknown command '{}': did you mean '{}'? '{}' lists all", text,
                         nearest_name(text, command_names(app)), help);
    }
    return fmt::format("Unexpected argument '{}': '{}' shows what {} takes", text, help,
                       command.get_name());
  }
  if (parsed.empty() && error.get_name() == "RequiredError") {
    return fmt::format("No command given: use one of {}; 'raysplats -h' explains them",
                       fmt::join(command_names(app), ", "));
  }
  return fmt::format("{} ('{}' explains the options)", error.what(), help);
}

}  // namespace raysplats::cli
