// SPDX-License-Identifier: Apache-2.0
#include "util/output_directory.hpp"

#include <doctest/doctest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <system_error>

#include "raysplats/error.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::data_error;

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
  const std::string longest(300, 'x');
  for (const std::filesystem::path& path :
       {folder / "file", folder / "file/below", folder / longest, folder / "new" / longest}) {
    CAPTURE(path.string());
    const std::string early = data_error([&] { check_output_directory(path); });
    CHECK(early.find("cannot be created") != std::string::npos);
    CHECK(early == data_error([&] { make_output_directory(path); }));
  }
  CHECK_THROWS_AS(check_output_directory({}), DataError);
}

TEST_CASE("a folder whose disk is full can be written no more than one that is locked") {
  const TemporaryDirectory folder;
  folder.write("file", "in the way");
  CHECK_FALSE(writing_trouble(folder.path()));
  CHECK_FALSE(writing_trouble(folder / "made/for it"));
  CHECK(writing_trouble(folder / "file/below") == std::errc::not_a_directory);
  CHECK(writing_trouble("/proc"));
  // A limit on the size of files in a child process stands for a full disk.
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1000, 1000};
    const bool noticed = ::setrlimit(RLIMIT_FSIZE, &limit) == 0 &&
                         writing_trouble(folder.path()) == std::errc::file_too_large;
    ::_exit(noticed ? 0 : 1);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
  CHECK(entries(folder.path()).size() == 2);  // nothing of the trials stays
}
