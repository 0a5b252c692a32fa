// SPDX-License-Identifier: Apache-2.0
#include "completion.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <functional>
#include <string_view>

#include "util/shell_word.hpp"

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

/// Whether files are offered for the value of an option: of numbers, names and devices none are.
bool is_file(const OptionEntry& option) {
  constexpr std::array<std::string_view, 7> kFiles{"DIR",  "DATA", "DATASET", "MODEL",
                                                   "PATH", "RUN",  "NETWORK"};
  return option.value.starts_with("FILE") || option.value == "VALUE" ||
         std::find(kFiles.begin(), kFiles.end(), option.value) != kFiles.end();
}

std::vector<std::string> below(const CommandEntry& command) {
  std::vector<std::string> names;
  for (const CommandEntry& each : command.commands) names.push_back(each.name);
  return names;
}

/// What may stand where no option does: commands below, and words of an argument that is one of a
/// few. Where there is nothing, files may.
std::vector<std::string> plain_words(const CommandEntry& command) {
  std::vector<std::string> words = below(command);
  for (const OptionEntry& option : command.options) {
    if (option.argument) words.insert(words.end(), option.choices.begin(), option.choices.end());
  }
  return words;
}

}  // namespace

std::string bash_completion(const CommandEntry& program) {
  const auto joined = [](const std::vector<std::string>& all) {
    return shell_quoted(fmt::format("{}", fmt::join(all, " ")));
  };
  std::string words, values, commands;
  const auto add = [&](const CommandEntry& command, const std::string& path) {
    const std::vector<std::string> plain = plain_words(command);
    words += fmt::format("    {}) words={} plain={} ;;\n", shell_quoted(path),
                         joined(named(command)), joined(plain));
    for (const OptionEntry& option : command.options) {
      if (option.argument || option.value.empty()) continue;
      for (const std::string& name : option.names) {
        values += fmt::format("    {}) {} ;;\n", shell_quoted(fmt::format("{} {}", path, name)),
                              !option.choices.empty()
                                  ? fmt::format("kind=words words={}", joined(option.choices))
                              : is_file(option) ? "kind=files"
                                                : "kind=none");
      }
    }
  };
  walk(program, "", [&](const CommandEntry& command, const std::string& path) {
    commands += fmt::format("      {0}) command={0} ;;\n", shell_quoted(path));
    add(command, path);
  });
  add(program, "");
  return fmt::format(R"(# bash completion of raysplats
_raysplats() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}}
  local command='' words='' plain='' kind='' i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case "${{command:+$command }}${{COMP_WORDS[i]}}" in
{}    esac
  done
  case "$command $before" in
{}  esac
  if [[ -z $kind ]]; then
    case "$command" in
{}    esac
    if [[ $current == -* ]]; then
      kind=words
    elif [[ -n $plain ]]; then
      kind=words words=$plain
    else
      kind=files
    fi
  fi
  COMPREPLY=()
  case $kind in
    words) COMPREPLY=($(compgen -W "$words" -- "$current")) ;;
    files) mapfile -t COMPREPLY < <(compgen -f -- "$current") ;;
  esac
}}
complete -o filenames -F _raysplats raysplats
)",
                     commands, values, words);
}

std::string zsh_completion(const CommandEntry& program) {
  const auto arguments = [](const CommandEntry& command) {
    std::string out;
    for (const OptionEntry& option : command.options) {
      if (option.argument) continue;
      const std::string action =
          option.value.empty() ? ""
          : option.choices.empty()
              ? fmt::format(":{}:{}", zsh_text(option.value), is_file(option) ? "_files" : " ")
              : fmt::format(":{}:({})", zsh_text(option.value), fmt::join(option.choices, " "));
      for (const std::string& name : option.names) {
        out +=
            fmt::format(" \\\n    {}",
                        shell_quoted(fmt::format("{}[{}]{}", name, zsh_text(option.text), action)));
      }
    }
    return out;
  };
  const auto everything = [&](const CommandEntry& command) {
    const std::vector<std::string> plain = plain_words(command);
    return fmt::format(
        "_arguments{} \\\n    {}", arguments(command),
        plain.empty() ? "'*:file:_files'" : fmt::format("'1:word:({})'", fmt::join(plain, " ")));
  };
  std::string list;
  std::string cases;
  for (const CommandEntry& command : program.commands) {
    list += fmt::format("    {}\n", shell_quoted(command.name + ":" + zsh_text(command.text)));
    for (const CommandEntry& below : command.commands) {
      cases += fmt::format("  '{} {}')\n    shift words\n    ((CURRENT--))\n    {} ;;\n",
                           command.name, below.name, everything(below));
    }
    cases += fmt::format("  {0} | '{0} '*) {1} ;;\n", command.name, everything(command));
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
  # The word below a command counts once it is over.
  ((CURRENT > 2)) && command+=" $words[2]"
  case $command in
{}  esac
}}
_raysplats "$@"
)",
                     list, cases);
}

std::string fish_completion(const CommandEntry& program) {
  std::string out = "# fish completion of raysplats\n";
  const auto add = [&](const CommandEntry& command, const std::string& condition) {
    const std::string when = condition.empty() ? "" : fmt::format(" -n {}", fish_quoted(condition));
    for (const OptionEntry& option : command.options) {
      const std::string choices = fish_quoted(fmt::format("{}", fmt::join(option.choices, " ")));
      out += "complete -c raysplats" + when;
      if (option.argument) {
        // Files, unless it is one of a few words.
        out += option.choices.empty() ? " -F\n" : fmt::format(" -f -a {}\n", choices);
        continue;
      }
      for (const std::string& name : option.names) {
        out += name.starts_with("--") ? " -l " + name.substr(2) : " -s " + name.substr(1);
      }
      if (!option.value.empty()) {
        out += !option.choices.empty() ? fmt::format(" -x -a {}", choices)
               : is_file(option)       ? " -r -F"
                                       : " -x";
      }
      out += fmt::format(" -d {}\n", fish_quoted(option.text));
    }
  };
  add(program, "");
  for (const CommandEntry& command : program.commands) {
    const std::string seen = "__fish_seen_subcommand_from " + command.name;
    out += fmt::format("complete -c raysplats -n __fish_use_subcommand -f -a {} -d {}\n",
                       command.name, fish_quoted(command.text));
    add(command, seen);
    for (const CommandEntry& below : command.commands) {
      const std::string deeper = "__fish_seen_subcommand_from " + below.name;
      out += fmt::format("complete -c raysplats -n {} -f -a {} -d {}\n",
                         fish_quoted(fmt::format("{}; and not {}", seen, deeper)), below.name,
                         fish_quoted(below.text));
      add(below, fmt::format("{}; and {}", seen, deeper));
    }
  }
  return out;
}

}  // namespace raysplats::cli
