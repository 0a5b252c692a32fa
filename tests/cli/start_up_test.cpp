// SPDX-License-Identifier: Apache-2.0
// What starts quickly stays quick: libraries that take longer to load than most commands to run are
// loaded by those that need them. Builds that link them leave this out.
#include <doctest/doctest.h>

#include <string>
#include <vector>

#include "program.hpp"

namespace {

/// Whether the dynamic linker was asked for OpenImageIO.
bool loads_pictures(const std::vector<std::string>& arguments) {
  const Outcome outcome = raysplats_program(arguments, {{{"LD_DEBUG", "files"}}});
  REQUIRE(outcome.code == 0);
  REQUIRE(outcome.err.find("libstdc++") != std::string::npos);
  return outcome.err.find("libOpenImageIO") != std::string::npos;
}

}  // namespace

TEST_CASE("commands without pictures load no library of pictures") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  CHECK_FALSE(loads_pictures({"--version"}));
  CHECK_FALSE(loads_pictures({"-h"}));
  CHECK_FALSE(loads_pictures({"info", folder / "balls.ply"}));
  CHECK(loads_pictures({"generate", folder / "data", "--size", "8", "--train-views", "1",
                        "--test-views", "1", "-q"}));
}
