// SPDX-License-Identifier: Apache-2.0
#include "util/file_kind.hpp"

#include <doctest/doctest.h>

#include <string>

#include "unit/no_rights.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;
using test::data_error;
namespace fs = std::filesystem;

TEST_CASE("a path that cannot be asked is not taken for one without anything") {
  const TemporaryDirectory folder;
  folder.write("file", "text");
  CHECK(is_there(folder.path()));
  CHECK(is_there(folder / "file"));
  CHECK(!is_there(folder / "none"));
  CHECK(!is_there(folder / "file/below"));
  fs::create_symlink("round", folder / "round");
  const auto refusal = [&](const fs::path& path) { return data_error([&] { is_there(path); }); };
  CHECK(contains(refusal(folder / "round"), "round cannot be read: Too many levels of symbolic"));
  CHECK(contains(refusal(folder / std::string(300, 'x')), "cannot be read: File name too long"));
  folder.write("closed/file", "text");
  fs::permissions(folder / "closed", fs::perms::none);
  std::string denied;
  {
    const NoRights none;
    denied = refusal(folder / "closed/file");
  }
  fs::permissions(folder / "closed", fs::perms::owner_all);
  CHECK(contains(denied, "file cannot be read: Permission denied"));
}
