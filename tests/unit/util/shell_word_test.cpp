// SPDX-License-Identifier: Apache-2.0
#include "util/shell_word.hpp"

#include <doctest/doctest.h>

using raysplats::shell_word;

TEST_CASE("words of commands are quoted where a shell would not read them whole") {
  CHECK(shell_word("runs/a-1_b.ply") == "runs/a-1_b.ply");
  CHECK(shell_word("my run") == "'my run'");
  CHECK(shell_word("it's") == "'it'\\''s'");
  CHECK(shell_word("~/run") == "'~/run'");
  CHECK(shell_word("$HOME") == "'$HOME'");
  CHECK(shell_word("") == "''");
}
