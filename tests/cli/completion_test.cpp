// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "program.hpp"

namespace {

using Words = std::set<std::string>;

/// What bash offers after the words of a line, the last of which is being typed.
Words offered(const TemporaryFolder& folder, const std::vector<std::string>& line) {
  std::string script = "source '" + (folder / "raysplats.bash") + "'\nCOMP_WORDS=(";
  for (const std::string& word : line) script += "'" + word + "' ";
  script += ")\nCOMP_CWORD=" + std::to_string(line.size() - 1) + "\ncd '" + folder.path().string() +
            "'\n_raysplats\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n";
  write_file(folder / "ask.sh", script);
  const std::string command =
      "bash --noprofile --norc '" + (folder / "ask.sh") + "' > '" + (folder / "answer") + "' 2>&1";
  REQUIRE(std::system(command.c_str()) == 0);
  std::istringstream lines(read_file(folder / "answer"));
  Words words;
  for (std::string word; std::getline(lines, word);) words.insert(word);
  return words;
}

bool runs(const std::string& command) {
  return std::system((command + " > /dev/null 2>&1").c_str()) == 0;
}

}  // namespace

TEST_CASE("bash completes commands, options, words of options and files") {
  const TemporaryFolder folder;
  const Outcome outcome = raysplats_program({"completion", "bash"});
  REQUIRE(outcome.code == 0);
  write_file(folder / "raysplats.bash", outcome.out);
  write_file(folder / "garden.ply", "");
  write_file(folder / "my *.ply", "");
  CHECK(offered(folder, {"raysplats", "info", "my"}) == Words{"my *.ply"});
  CHECK(offered(folder, {"raysplats", "tr"}) == Words{"train", "trace"});
  CHECK(offered(folder, {"raysplats", "train", "--val"}) ==
        Words{"--validate-every", "--validate-views"});
  CHECK(offered(folder, {"raysplats", "render", "m.ply", "--format", ""}) ==
        Words{"exr", "png", "jpg"});
  CHECK(offered(folder, {"raysplats", "render", "gar"}) == Words{"garden.ply"});
  CHECK(offered(folder, {"raysplats", "train", "d", "-o", "gar"}) == Words{"garden.ply"});
}

TEST_CASE("scripts for other shells name every command and option, and their shells take them") {
  const TemporaryFolder folder;
  const Outcome help = raysplats_program({"train", "-h"});
  for (const std::string shell : {"zsh", "fish"}) {
    const Outcome outcome = raysplats_program({"completion", shell});
    REQUIRE(outcome.code == 0);
    for (const char* part : {"train", "convert", "quality", "medium", "adaptive-radius"})
      CHECK_MESSAGE(outcome.out.find(part) != std::string::npos, shell << ": " << part);
    write_file(folder / shell, outcome.out);
    if (runs("command -v " + shell)) CHECK(runs(shell + " -n '" + (folder / shell) + "'"));
  }
  CHECK(raysplats_program({"completion", "tcsh"}).code == 2);
}

TEST_CASE("manual pages hold every command and option, and roff has nothing to say about them") {
  const TemporaryFolder folder;
  REQUIRE(raysplats_program({"manual", folder / "man"}).code == 0);
  std::size_t pages = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "man")) {
    ++pages;
    const std::string page = read_file(entry.path().string());
    INFO(entry.path().string());
    for (const char* part : {".TH RAYSPLATS", ".SH NAME", ".SH SYNOPSIS", ".SH OPTIONS"})
      CHECK(page.find(part) != std::string::npos);
    if (runs("command -v groff")) {
      const std::string command =
          "test -z \"$(groff -man -ww -Tutf8 -z '" + entry.path().string() + "' 2>&1)\"";
      CHECK(runs(command));
    }
  }
  CHECK(pages == 17);
  const std::string train = read_file(folder / "man/raysplats-train.1");
  CHECK(train.find("\\fB\\-\\-densify\\-until\\fR") != std::string::npos);
  CHECK(train.find("One of: ") != std::string::npos);
}
