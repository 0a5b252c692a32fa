// SPDX-License-Identifier: Apache-2.0
#include "util/atomic_file.hpp"

#include <doctest/doctest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "raysplats/error.hpp"
#include "unit/no_rights.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::data_error;
namespace fs = std::filesystem;

namespace {

int sync_failure = 0;  // what fsync() fails with; 0: it is the system's

}  // namespace

// In place of the C library's, in this program: no file system that does not know it is at hand.
extern "C" int fsync(int descriptor) {
  if (sync_failure == 0) return static_cast<int>(::syscall(SYS_fsync, descriptor));
  errno = sync_failure;
  return -1;
}

TEST_CASE("atomic file: the target changes at commit and not before") {
  const TemporaryDirectory folder;
  const fs::path target = folder / "model.ply";
  write_text_file(target, "old");
  {
    AtomicFile file(target);
    file.write("new ");
    file.write("text");
    CHECK(read_bytes(target) == "old");
    CHECK(file.temporary().extension() == ".ply");
    CHECK(file.temporary().parent_path() == folder.path());
    file.commit();
    CHECK(read_bytes(target) == "new text");
  }
  CHECK(read_bytes(target) == "new text");
  CHECK(entries(folder.path()).size() == 1);
}

TEST_CASE("atomic file: two writers of one file have temporary files of their own") {
  // Processes on machines that share the folder may have one number.
  const TemporaryDirectory folder;
  const fs::path target = folder / "model.ply";
  AtomicFile first(target);
  AtomicFile second(target);
  CHECK(first.temporary() != second.temporary());
  first.write("first");
  second.write("the second");
  second.commit();
  CHECK(read_bytes(target) == "the second");
  first.commit();
  CHECK(read_bytes(target) == "first");
}

TEST_CASE("atomic file: what a killed process has left is removed, what one still writes is not") {
  const TemporaryDirectory folder;
  fs::path left;
  {
    const AtomicFile file(folder / "model.ply");
    left = file.temporary();
  }
  write_bytes(left, "half");
  AtomicFile living(folder / "picture.png");
  living.write("pixels");
  CHECK(remove_stale_temporaries(folder.path()) == 1);
  CHECK(!fs::exists(left));
  living.commit();
  CHECK(read_bytes(folder / "picture.png") == "pixels");
  CHECK(remove_stale_temporaries(folder.path()) == 0);
}

TEST_CASE("atomic file: without commit nothing remains") {
  const TemporaryDirectory folder;
  const fs::path target = folder / "out.txt";
  {
    AtomicFile file(target);
    file.write("half");
    CHECK(entries(folder.path()).size() == 1);
  }
  CHECK(entries(folder.path()).size() == 0);
  write_text_file(target, "old");
  {
    AtomicFile file(target);
    file.write("half");
  }
  CHECK(read_bytes(target) == "old");
  CHECK(entries(folder.path()).size() == 1);
}

TEST_CASE("atomic file: a library may write the temporary file itself") {
  const TemporaryDirectory folder;
  AtomicFile file(folder / "image.png");
  std::ofstream(file.temporary(), std::ios::binary) << "pixels";
  file.commit();
  CHECK(read_bytes(folder / "image.png") == "pixels");
}

TEST_CASE("atomic file: a name may be as long as names can be") {
  const TemporaryDirectory folder;
  std::string letters;  // of two bytes each, so that any cut could fall into one
  while (letters.size() < 250) letters += "\u00e4";
  for (const std::string& name : {letters + "x.ply", "y" + letters + ".ply", "z." + letters}) {
    CAPTURE(name);
    AtomicFile file(folder / name);
    const std::string temporary = file.temporary().filename().string();
    CHECK(temporary.size() <= 160);
    std::size_t whole = 0;
    for (std::size_t i = 0; i + 1 < temporary.size(); ++i)
      whole += temporary.compare(i, 2, "\u00e4") == 0 ? 1 : 0;
    CHECK(std::count(temporary.begin(), temporary.end(), '\xc3') == static_cast<long>(whole));
    file.write("text");
    file.commit();
    CHECK(read_bytes(folder / name) == "text");
    write_bytes(folder / temporary, "half");
    CHECK(remove_stale_temporaries(folder.path()) == 1);
  }
}

TEST_CASE("atomic file: folders are made, bytes are kept as they are") {
  const TemporaryDirectory folder;
  const std::string bytes("a\0b\r\n\xff", 6);
  write_text_file(folder / "x/y/z.bin", bytes);
  CHECK(read_bytes(folder / "x/y/z.bin") == bytes);
  write_text_file(folder / "empty", "");
  CHECK(fs::file_size(folder / "empty") == 0);
}

TEST_CASE("atomic file: a folder that cannot be written names the path and the reason") {
  const TemporaryDirectory folder;
  write_text_file(folder / "file", "text");
  const std::string below_file =
      data_error([&] { write_text_file(folder / "file/below.txt", "x"); });
  CHECK(below_file.find("below.txt") != std::string::npos);
  CHECK(below_file.find("Not a directory") != std::string::npos);
  const std::string over_folder = data_error([&] {
    fs::create_directory(folder / "sub");
    write_text_file(folder / "sub/inner", "x");
    write_text_file(folder / "sub", "x");
  });
  CHECK(over_folder.find("sub is a folder") != std::string::npos);
  CHECK(read_bytes(folder / "sub/inner") == "x");
  if (::geteuid() != 0) {  // root may write anywhere
    fs::permissions(folder.path(), fs::perms::owner_read | fs::perms::owner_exec);
    const std::string denied = data_error([&] { write_text_file(folder / "new.txt", "x"); });
    CHECK(denied.find("Permission denied") != std::string::npos);
    fs::permissions(folder.path(), fs::perms::owner_all);
  }
}

TEST_CASE("atomic file: a folder that cannot be made names the system's reason") {
  const TemporaryDirectory folder;
  fs::permissions(folder.path(), static_cast<fs::perms>(0555));
  std::string denied;
  {
    const NoRights none;
    denied = data_error([&] { write_text_file(folder / "new/a.txt", "x"); });
  }
  fs::permissions(folder.path(), fs::perms::owner_all);
  CHECK(denied.find("a.txt cannot be created: Permission denied") != std::string::npos);
}

TEST_CASE("atomic file: who may read a file stays, and is asked of umask for a new one") {
  const TemporaryDirectory folder;
  const auto mode = [&](const char* name) {
    return static_cast<unsigned>(fs::status(folder / name).permissions());
  };
  const mode_t before = ::umask(0027);
  write_text_file(folder / "new", "x");
  CHECK(mode("new") == 0640);
  for (const unsigned kept : {0600u, 0444u, 0664u}) {
    fs::permissions(folder / "new", static_cast<fs::perms>(kept));
    AtomicFile file(folder / "new");
    const auto meanwhile = static_cast<unsigned>(fs::status(file.temporary()).permissions());
    CHECK((meanwhile & ~kept & 0077) == 0);
    CHECK((meanwhile & 0600) == 0600);
    file.commit();
    CHECK(mode("new") == kept);
  }
  ::umask(before);
}

TEST_CASE("atomic file: a full disk keeps the old file and leaves no temporary one") {
  const TemporaryDirectory folder;
  const fs::path target = folder / "model.ply";
  write_text_file(target, "old");
  // A limit on the size of files in a child process stands for a full disk.
  const pid_t child = ::fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{1000, 1000};
    int status = 1;
    if (::setrlimit(RLIMIT_FSIZE, &limit) == 0) {
      const std::string message =
          data_error([&] { write_text_file(target, std::string(5000, 'x')); });
      status =
          message.find("model.ply cannot be written: File too large") != std::string::npos ? 0 : 2;
    }
    ::_exit(status);
  }
  int status = 0;
  ::waitpid(child, &status, 0);
  CHECK(WIFEXITED(status));
  CHECK(WEXITSTATUS(status) == 0);
  CHECK(read_bytes(target) == "old");
  CHECK(entries(folder.path()).size() == 1);
}

TEST_CASE("atomic file: a file system that knows no sync is no failure, one that fails is") {
  const TemporaryDirectory folder;
  const auto outcome = [&](int reason) {
    sync_failure = reason;
    std::string message =
        data_error([&] { write_text_file(folder / "model.ply", std::to_string(reason)); });
    sync_failure = 0;
    return message;
  };
  for (const int reason : {EINVAL, ENOSYS, EOPNOTSUPP}) {
    CAPTURE(reason);
    CHECK(outcome(reason).empty());
    CHECK(read_bytes(folder / "model.ply") == std::to_string(reason));
  }
  CHECK(outcome(EIO).find("model.ply cannot be synced") != std::string::npos);
  CHECK(read_bytes(folder / "model.ply") == std::to_string(EOPNOTSUPP));
  CHECK(entries(folder.path()).size() == 1);
}

TEST_CASE("atomic file: a link stays one, a pipe stays a pipe") {
  const TemporaryDirectory folder;
  const fs::path target = folder / "model.ply", link = folder / "link.ply";
  write_text_file(target, "old");
  fs::create_symlink("model.ply", link);
  write_text_file(link, "new");
  CHECK(fs::is_symlink(link));
  CHECK(read_bytes(target) == "new");
  fs::create_symlink("later.ply", folder / "ahead.ply");
  write_text_file(folder / "ahead.ply", "text");
  CHECK(read_bytes(folder / "later.ply") == "text");
  const fs::path pipe = folder / "pipe";
  REQUIRE(::mkfifo(pipe.c_str(), 0600) == 0);
  CHECK_THROWS_AS(AtomicFile{pipe}, DataError);
  CHECK(fs::is_fifo(pipe));
}

TEST_CASE("atomic file: what is no file's name is refused before a folder is made for it") {
  const TemporaryDirectory folder;
  CHECK(data_error([&] { AtomicFile{fs::path()}; }).find("names no file") != std::string::npos);
  CHECK(data_error([&] { AtomicFile{folder / "new/"}; }).find("names no file") !=
        std::string::npos);
  fs::create_directory_symlink(folder.path(), folder / "link");
  CHECK(data_error([&] { AtomicFile{folder / "link"}; }).find("is a folder") != std::string::npos);
  CHECK(entries(folder.path()).size() == 1);
}

TEST_CASE("atomic file: what stands before is known behind, and writing goes on at the end") {
  const TemporaryDirectory folder;
  AtomicFile file(folder / "a");
  file.write("??? two");
  file.write_at(0, "one", 3);
  file.write(" three");
  file.commit();
  CHECK(read_bytes(folder / "a") == "one two three");
}

TEST_CASE("output files: what is there stays unless it may be replaced, what is read always") {
  const TemporaryDirectory folder;
  write_text_file(folder / "a", "read");
  write_text_file(folder / "b", "old");
  fs::create_symlink("a", folder / "link");
  fs::create_symlink("later", folder / "ahead");
  const auto refusal = [&](const char* name, bool overwrite) -> std::string {
    try {
      check_output_file(folder / name, overwrite, {folder / "none", folder / "a"});
    } catch (const UsageError& error) {
      return error.what();
    }
    return "";
  };
  CHECK(refusal("b", false).find("b is there already") != std::string::npos);
  CHECK(refusal("b", true).empty());
  for (const char* read : {"a", "link"}) {
    for (const bool overwrite : {false, true})
      CHECK(refusal(read, overwrite).find("is what is read") != std::string::npos);
  }
  for (const char* name : {"ahead", "new", "new/below"}) CHECK(refusal(name, false).empty());
  CHECK(data_error([&] { check_output_file(folder.path(), true); }).find("is a folder") !=
        std::string::npos);
  CHECK(entries(folder.path()).size() == 4);
}
