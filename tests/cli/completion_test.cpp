// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "../skip_test.hpp"
#include "program.hpp"

namespace {

using Choices = std::set<std::string>;

/// What bash offers after the words of a line, the last of which is being typed.
Choices offered(const TemporaryFolder& folder, const std::vector<std::string>& line) {
  std::string script = "source '" + (folder / "raysplats.bash") + "'\nCOMP_WORDS=(";
  for (const std::string& word : line) script += "'" + word + "' ";
  script += ")\nCOMP_CWORD=" + std::to_string(line.size() - 1) + "\ncd '" + folder.path().string() +
            "'\n_raysplats\nprintf '%s\\n' \"${COMPREPLY[@]}\"\n";
  write_file(folder / "ask.sh", script);
  const std::string command =
      "bash --noprofile --norc '" + (folder / "ask.sh") + "' > '" + (folder / "answer") + "' 2>&1";
  REQUIRE(std::system(command.c_str()) == 0);
  std::istringstream lines(read_file(folder / "answer"));
  Choices words;
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
  CHECK(offered(folder, {"raysplats", "info", "my"}) == Choices{"my *.ply"});
  CHECK(offered(folder, {"raysplats", "tr"}) == Choices{"train", "trace"});
  CHECK(offered(folder, {"raysplats", "train", "--val"}) ==
        Choices{"--validate-every", "--validate-views"});
  CHECK(offered(folder, {"raysplats", "render", "m.ply", "--format", ""}) ==
        Choices{"exr", "png", "jpg"});
  CHECK(offered(folder, {"raysplats", "render", "gar"}) == Choices{"garden.ply"});
  CHECK(offered(folder, {"raysplats", "train", "d", "-o", "gar"}) == Choices{"garden.ply"});
  // Arguments of a few words, commands below commands, and values that are no files.
  CHECK(offered(folder, {"raysplats", "completion", ""}) == Choices{"bash", "fish", "zsh"});
  CHECK(offered(folder, {"raysplats", "bench", ""}) == Choices{"compare"});
  CHECK(offered(folder, {"raysplats", "bench", "--json", "gar"}) == Choices{"garden.ply"});
  CHECK(offered(folder, {"raysplats", "bench", "compare", "gar"}) == Choices{"garden.ply"});
  CHECK(offered(folder, {"raysplats", "train", "--device", ""}) == Choices{""});
}

TEST_CASE("fish completes the same, where it is installed") {
  SKIP_TEST_UNLESS(runs("command -v fish"), "there is no fish");
  const TemporaryFolder folder;
  write_file(folder / "a.fish", raysplats_program({"completion", "fish"}).out);
  write_file(folder / "garden.ply", "");
  const auto fish = [&](const std::string& line) {
    const std::string command =
        "cd '" + folder.path().string() + "' && HOME='" + folder.path().string() +
        "' fish -c \"source a.fish; complete -C '" + line + "'\" 2>/dev/null | cut -f1 > answer";
    REQUIRE(std::system(command.c_str()) == 0);
    std::istringstream lines(read_file(folder / "answer"));
    Choices words;
    for (std::string word; std::getline(lines, word);) words.insert(word);
    return words;
  };
  CHECK(fish("raysplats completion ") == Choices{"bash", "fish", "zsh"});
  CHECK(fish("raysplats bench com") == Choices{"compare"});
  CHECK(fish("raysplats info gar") == Choices{"garden.ply"});
  CHECK(fish("raysplats bench compare gar") == Choices{"garden.ply"});
  CHECK(fish("raysplats train --quality me") == Choices{"medium"});
  CHECK(fish("raysplats train --device gar").empty());
}

TEST_CASE("zsh completes the same, where it is installed") {
  SKIP_TEST_UNLESS(runs("command -v zsh"), "there is no zsh");
  const TemporaryFolder folder;
  write_file(folder / "functions/_raysplats", raysplats_program({"completion", "zsh"}).out);
  write_file(folder / "garden.ply", "");
  // A shell on a terminal of its own, as completion runs in no other; what it offers is printed in
  // its place.
  write_file(folder / "ask.zsh", R"(zmodload zsh/zpty
cd $1
zpty -b shell zsh -f -i
zpty -w shell "PS1='' ; fpath=($1/functions \$fpath); autoload -Uz compinit; compinit -u -d $1/dump"
zpty -w shell "zstyle ':completion:*' list-separator ''; compadd() { builtin compadd -O found \"\$@\"; print -r -- \"<\${(j:,:)found}>\" >> $1/answer; builtin compadd \"\$@\"; }"
zpty -w shell "print ready > $1/ready"
while [[ ! -e $1/ready ]]; do sleep 0.1; done
zpty -n -w shell "$2"$'\t'
for i in {1..50}; do sleep 0.1; [[ -e $1/answer ]] && break; done
sleep 0.3
zpty -d shell
)");
  const auto zsh = [&](const std::string& line) {
    for (const char* left : {"answer", "ready"}) std::filesystem::remove(folder / left);
    const std::string command = "zsh -f '" + (folder / "ask.zsh") + "' '" + folder.path().string() +
                                "' '" + line + "' > /dev/null 2>&1";
    REQUIRE(std::system(command.c_str()) == 0);
    return std::filesystem::exists(folder / "answer") ? read_file(folder / "answer") : "";
  };
  const auto offers = [&](const std::string& line, const std::string& word) {
    const std::string all = zsh(line);
    CAPTURE(all);
    CHECK(all.find(word) != std::string::npos);
  };
  offers("raysplats completion ", "bash,zsh,fish");
  offers("raysplats bench ", "compare");
  offers("raysplats bench compare gar", "garden.ply");
  CHECK(zsh("raysplats train --device gar").find("garden") == std::string::npos);
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
