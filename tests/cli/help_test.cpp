// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <algorithm>
#include <sstream>
#include <string>
#include <vector>

#include "build_paths.hpp"
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

TEST_CASE("docs/cli.md lists what --help-all lists") {
  const std::string page = read_file(raysplats::test::source_dir() + "/docs/cli.md");
  for (const std::vector<std::string>& command : {std::vector<std::string>{"devices"},
                                                  {"doctor"},
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
    words.emplace_back("--help-all");
    const Outcome help = raysplats_program(words);
    REQUIRE(help.code == 0);
    INFO(command.back() << ": scripts/cli_help.sh writes this section");
    CHECK(page.find("```text\n" + trimmed(help.out) + "```\n") != std::string::npos);
  }
}

TEST_CASE("-h shows what most people need and says how much more there is") {
  const auto lines = [](const std::string& text) {
    return std::count(text.begin(), text.end(), '\n');
  };
  const Outcome brief = raysplats_program({"train", "-h"});
  const Outcome whole = raysplats_program({"train", "--help-all"});
  CHECK(brief.code == 0);
  CHECK(whole.code == 0);
  CHECK(lines(brief.out) * 2 < lines(whole.out));
  CHECK(brief.out.find(" more options: raysplats train --help-all\n") != std::string::npos);
  CHECK(whole.out.find("more options") == std::string::npos);
  for (const char* option : {"--iterations", "--quality", "--max-gaussians", "--device"})
    CHECK(brief.out.find(option) != std::string::npos);
  CHECK(brief.out.find("--adam-beta1") == std::string::npos);
  CHECK(whole.out.find("--adam-beta1") != std::string::npos);
  // Nothing is left out of a short list, and commands do not take each other's place.
  CHECK(raysplats_program({"report", "-h"}).out.find("more options") == std::string::npos);
  CHECK(raysplats_program({"render", "-h"}).out.find("raysplats render --help-all") !=
        std::string::npos);
  CHECK(raysplats_program({"--help-all"}).out.find("--adam-beta1") != std::string::npos);
}

TEST_CASE("--help-all shows defaults that can be pasted") {
  const Outcome help = raysplats_program({"train", "--help-all"});
  CHECK(help.out.find("--adaptive-radius,--no-adaptive-radius [default: true]") !=
        std::string::npos);
  CHECK(help.out.find("{false}") == std::string::npos);
  CHECK(help.out.find("=[") == std::string::npos);
  CHECK(help.out.find("--eval-at LIST [default: ") != std::string::npos);
}
