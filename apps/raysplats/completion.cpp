// SPDX-License-Identifier: Apache-2.0
#include "completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <functional>

#include "options.hpp"

namespace raysplats::cli {
namespace {

/// In single quotes of fish, where a backslash counts.
std::string fish_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'' || c == '\\') out += '\\';
    out += c;
  }
  return out + "'";
}

/// With the signs that zsh gives a meaning in a description.
std::string zsh_text(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

/// Calls `visit` for every command with its words: "train", "bench compare".
void walk(const CommandEntry& command,
          const std::string& words,
          const std::function<void(const CommandEntry&, const std::string&)>& visit) {
  for (const CommandEntry& below : command.commands) {
    const std::string all = words.empty() ? below.name : words + " " + below.name;
    visit(below, all);
    walk(below, all, visit);
  }
}

std::vector<std::string> named(const CommandEntry& command) {
  std::vector<std::string> names;
  for (const OptionEntry& option : command.options) {
    if (!option.argument) names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return names;
}

std::vector<std::string> below(const CommandEntry& command) {
  std::vector<std::string> names;
  for (const CommandEntry& each : command.commands) names.push_back(each.name);
  return names;
}

}  // namespace

std::string bash_completion(const CommandEntry& program) {
  std::string words;
  std::string choices;
  const auto add = [&](const CommandEntry& command, const std::string& path) {
    std::vector<std::string> all = below(command);
    for (const std::string& name : named(command)) all.push_back(name);
    words += fmt::format("    {}) words={} ;;\n", shell_quoted(path),
                         shell_quoted(fmt::format("{}", fmt::join(all, " "))));
    for (const OptionEntry& option : command.options) {
      if (option.choices.empty() || option.argument) continue;
      for (const std::string& name : option.names) {
        choices +=
            fmt::format("    {}) words={} ;;\n", shell_quoted(fmt::format("{} {}", path, name)),
                        shell_quoted(fmt::format("{}", fmt::join(option.choices, " "))));
      }
    }
  };
  std::string commands;
  walk(program, "", [&](const CommandEntry& command, const std::string& path) {
    commands += fmt::format("      {}) command={} ;;\n", shell_quoted(path), shell_quoted(path));
    add(command, path);
  });
  add(program, "");
  return fmt::format(R"(# bash completion of raysplats
_raysplats() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}}
  local command='' words='' i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "${{command:+$command }}${{COMP_WORDS[i]}}" in
{}    esac
  done
  case "$command $before" in
{}    *) words='' ;;
  esac
  if [[ -n $words ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$current"))
    return
  fi
  case "$command" in
{}  esac
  if [[ $current == -* || -z $command ]]; then
    COMPREPLY=($(compgen -W "$words" -- "$current"))
  else
    mapfile -t COMPREPLY < <(compgen -f -- "$current")
  fi
}}
complete -o filenames -F _raysplats raysplats
)",
                     commands, choices, words);
}

std::string zsh_completion(const CommandEntry& program) {
  const auto arguments = [](const CommandEntry& command) {
    std::string out;
    for (const OptionEntry& option : command.options) {
      if (option.argument) continue;
      const std::string action =
          option.value.empty() ? ""
          : option.choices.empty()
              ? fmt::format(":{}:_files", zsh_text(option.value))
              : fmt::format(":{}:({})", zsh_text(option.value), fmt::join(option.choices, " "));
      for (const std::string& name : option.names) {
        out +=
            fmt::format(" \\\n    {}",
                        shell_quoted(fmt::format("{}[{}]{}", name, zsh_text(option.text), action)));
      }
    }
    return out;
  };
  std::string list;
  std::string cases;
  for (const CommandEntry& command : program.commands) {
    list += fmt::format("    {}\n", shell_quoted(command.name + ":" + zsh_text(command.text)));
    cases += fmt::format("  {}) _arguments{} \\\n    '*:file:_files' ;;\n", command.name,
                         arguments(command));
  }
  return fmt::format(R"(#compdef raysplats
# zsh completion of raysplats
_raysplats() {{
  local -a commands=(
{}  )
  if ((CURRENT == 2)); then
    _describe command commands
    return
  fi
  local command=$words[2]
  shift words
  ((CURRENT--))
  case $command in
{}  esac
}}
_raysplats "$@"
)",
                     list, cases);
}

std::string fish_completion(const CommandEntry& program) {
  std::string out = "# fish completion of raysplats\n";
  const auto options = [&](const CommandEntry& command, const std::string& condition) {
    for (const OptionEntry& option : command.options) {
      if (option.argument) continue;
      out += "complete -c raysplats" + condition;
      for (const std::string& name : option.names) {
        out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      if (!option.value.empty()) out += " -r";
      if (!option.choices.empty()) {
        out += fmt::format(" -f -a {}",
                           fish_quoted(fmt::format("{}", fmt::join(option.choices, " "))));
      }
      out += fmt::format(" -d {}\n", fish_quoted(option.text));
    }
  };
  for (const CommandEntry& command : program.commands) {
    out += fmt::format("complete -c raysplats -n __fish_use_subcommand -f -a {} -d {}\n",
                       command.name, fish_quoted(command.text));
  }
  options(program, "");
  for (const CommandEntry& command : program.commands)
    options(command, fmt::format(" -n '__fish_seen_subcommand_from {}'", command.name));
  return out;
}

}  // namespace raysplats::cli
