// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cctype>

#include "completion.hpp"

namespace raysplats::cli {
namespace {

/// Text as roff shows it: nothing in it is a request, hyphens can be pasted.
std::string roff(const std::string& text) {
  std::string out;
  if (!text.empty() && (text.front() == '.' || text.front() == '\'')) out += "\\&";
  for (const char c : text) {
    if (c == '\\') {
      out += "\\e";
    } else if (c == '-') {
      out += "\\-";
    } else {
      out += c;
    }
  }
  return out;
}

std::string title(const std::string& name, const std::string& version) {
  std::string upper;
  for (const char c : name) upper += static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return fmt::format(".TH {} 1 \"\" \"RaySplats\\-CL {}\" \"User Commands\"\n", roff(upper),
                     roff(version));
}

std::string options_section(const CommandEntry& command) {
  std::string out;
  for (const OptionEntry& option : command.options) {
    std::vector<std::string> names;
    for (const std::string& name : option.names)
      names.push_back(fmt::format("\\fB{}\\fR", roff(name)));
    out += fmt::format(".TP\n{}", fmt::join(names, ", "));
    if (!option.value.empty() && !option.argument)
      out += fmt::format(" \\fI{}\\fR", roff(option.value));
    out += fmt::format("\n{}", roff(option.text));
    if (!option.choices.empty())
      out += fmt::format("\n.br\nOne of: {}.",
                         roff(fmt::format("{}", fmt::join(option.choices, ", "))));
    if (!option.initial.empty()) out += fmt::format("\n.br\nDefault: {}.", roff(option.initial));
    out += "\n";
  }
  return out;
}

}  // namespace

std::string manual_page(const CommandEntry& program, const std::string& version) {
  std::string out = title(program.name, version);
  out += fmt::format(".SH NAME\n{} \\- {}\n", roff(program.name), roff(program.text));
  out += fmt::format(".SH SYNOPSIS\n.B {}\n.I COMMAND\n[\\fIoptions\\fR]\n.SH COMMANDS\n",
                     roff(program.name));
  for (const CommandEntry& command : program.commands) {
    out += fmt::format(".TP\n\\fB{}\\fR(1)\n{}\n", roff(program.name + "-" + command.name),
                       roff(command.text));
  }
  out += ".SH OPTIONS\n" + options_section(program);
  out +=
      ".SH EXIT STATUS\n"
      "0 success; 1 failure at run time; 2 wrong use; 3 wrong data; 4 device; 5 memory; 130 "
      "interrupted.\n";
  return out;
}

std::string manual_page(const CommandEntry& program,
                        const CommandEntry& command,
                        const std::string& version) {
  const std::string name = program.name + "-" + command.name;
  std::string out = title(name, version);
  out += fmt::format(".SH NAME\n{} \\- {}\n", roff(name), roff(command.text));
  out += fmt::format(".SH SYNOPSIS\n.B {} {}\n[\\fIoptions\\fR]", roff(program.name),
                     roff(command.name));
  for (const OptionEntry& option : command.options) {
    if (option.argument) out += fmt::format("\n.I {}", roff(option.names.front()));
  }
  out += "\n.SH OPTIONS\n" + options_section(command);
  for (const CommandEntry& below : command.commands) {
    out += fmt::format(".SH COMMAND {}\n{}\n{}", roff(below.name), roff(below.text),
                       options_section(below));
  }
  out += fmt::format(".SH SEE ALSO\n.BR {} (1)\n", roff(program.name));
  return out;
}

}  // namespace raysplats::cli
