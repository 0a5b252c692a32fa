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

TEST_CASE("a library of pictures that was not built with the program is refused") {
  const auto refusal = [](const std::string& library) {
    const TemporaryFolder folder;
    const Outcome outcome = raysplats_program({"generate", folder / "data", "--size", "8",
                                               "--train-views", "1", "--test-views", "1", "-q"},
                                              {{{"RAYSPLATS_IMAGES", library}}});
    CAPTURE(outcome.err);
    CHECK(outcome.code == 1);
    CHECK(one_sentence(outcome));
    CHECK(outcome.err.find("built with this program, version " RAYSPLATS_VERSION) !=
          std::string::npos);
    return outcome.err;
  };
  const std::string folder_of_libraries = RAYSPLATS_LIBRARIES;
  CHECK(refusal(folder_of_libraries + "/libimages_of_another_version.so")
            .find("libimages_of_another_version.so is of version 0.0.1") != std::string::npos);
  for (const char* name : {"libimages_of_another_interface.so", "libimages_without_interface.so"}) {
    CHECK(refusal(folder_of_libraries + "/" + name)
              .find(std::string(name) + " has another interface than this program") !=
          std::string::npos);
  }
  CHECK(refusal("libm.so.6").find("libm.so.6 is not the library of this program") !=
        std::string::npos);
  CHECK(refusal("/nonexistent").find("/nonexistent") != std::string::npos);
}

TEST_CASE("commands without pictures load no library of pictures") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(2));
  CHECK_FALSE(loads_pictures({"--version"}));
  CHECK_FALSE(loads_pictures({"-h"}));
  CHECK_FALSE(loads_pictures({"info", folder / "balls.ply"}));
  CHECK(loads_pictures({"generate", folder / "data", "--size", "8", "--train-views", "1",
                        "--test-views", "1", "-q"}));
}
