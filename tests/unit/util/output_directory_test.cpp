// SPDX-License-Identifier: Apache-2.0
#include "util/output_directory.hpp"

#include <doctest/doctest.h>

#include <filesystem>
#include <string>

#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;

namespace {

template <class Function>
std::string refusal(const Function& function) {
  try {
    function();
  } catch (const DataError& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("checking an output folder makes nothing") {
  const TemporaryDirectory folder;
  check_output_directory(folder.path());
  check_output_directory(folder / "a/b/");
  CHECK(std::filesystem::is_empty(folder.path()));
  make_output_directory(folder / "a/b/");
  CHECK(std::filesystem::is_directory(folder / "a/b"));
}

TEST_CASE("an output folder that cannot be is refused alike, beforehand and when it is made") {
  const TemporaryDirectory folder;
  folder.write("file", "in the way");
  for (const std::filesystem::path& path : {folder / "file", folder / "file/below"}) {
    CAPTURE(path.string());
    const std::string early = refusal([&] { check_output_directory(path); });
    CHECK(early.find("cannot be created") != std::string::npos);
    CHECK(early == refusal([&] { make_output_directory(path); }));
  }
  CHECK_THROWS_AS(check_output_directory({}), DataError);
}
