// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <sstream>
#include <string>
#include <vector>

#include "program.hpp"

namespace {

/// Without spaces at the ends of lines and empty lines at the end.
std::string trimmed(const std::string& text) {
  std::istringstream lines(text);
  std::string out;
  std::string line;
  while (std::getline(lines, line)) out += line.erase(line.find_last_not_of(' ') + 1) + "\n";
  while (out.ends_with("\n\n")) out.pop_back();
  return out;
}

}  // namespace

TEST_CASE("docs/cli.md lists what -h lists") {
  const std::string page = read_file(std::string(RAYSPLATS_SOURCE_DIR) + "/docs/cli.md");
  for (const std::vector<std::string>& command : {std::vector<std::string>{"devices"},
                                                  {"generate"},
                                                  {"prepare"},
                                                  {"train"},
                                                  {"render"},
                                                  {"eval"},
                                                  {"trace"},
                                                  {"info"},
                                                  {"convert"},
                                                  {"view"},
                                                  {"report"},
                                                  {"bench"},
                                                  {"bench", "compare"},
                                                  {"tune"},
                                                  {"completion"},
                                                  {"manual"}}) {
    std::vector<std::string> words = command;
    words.emplace_back("-h");
    const Outcome help = raysplats_program(words);
    REQUIRE(help.code == 0);
    INFO(command.back() << ": scripts/cli_help.sh writes this section");
    CHECK(page.find("```text\n" + trimmed(help.out) + "```\n") != std::string::npos);
  }
}

TEST_CASE("-h shows defaults that can be pasted") {
  const Outcome help = raysplats_program({"train", "-h"});
  CHECK(help.out.find("--adaptive-radius,--no-adaptive-radius [default: true]") !=
        std::string::npos);
  CHECK(help.out.find("{false}") == std::string::npos);
  CHECK(help.out.find("=[") == std::string::npos);
  CHECK(help.out.find("--eval-at LIST [default: ") != std::string::npos);
}
