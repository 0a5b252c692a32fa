// SPDX-License-Identifier: Apache-2.0
#include "util/file_lock.hpp"

#include <doctest/doctest.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <string>

#include "raysplats/error.hpp"
#include "unit/log_capture.hpp"
#include "unit/temporary_directory.hpp"
#include "unit/text.hpp"

using namespace raysplats;
using test::contains;
using test::data_error;

namespace {

int lock_failure = 0;  // what flock() fails with; 0: it is the system's

}  // namespace

// In place of the C library's, in this program: no file system without locks is at hand.
extern "C" int flock(int descriptor, int operation) noexcept {
  if (lock_failure == 0) return static_cast<int>(::syscall(SYS_flock, descriptor, operation));
  errno = lock_failure;
  return -1;
}

TEST_CASE("file lock: one has it at a time, and whoever comes next hears of which process") {
  const TemporaryDirectory folder;
  std::optional<FileLock> first(std::in_place, folder / ".lock");
  const std::string refusal = data_error([&] { FileLock{folder / ".lock"}; });
  CHECK(contains(refusal, folder.path().string() + " is in use by another run"));
  CHECK(contains(refusal, "(process " + std::to_string(::getpid()) + ")"));
  first.reset();
  const FileLock second(folder / ".lock");
}

TEST_CASE("file lock: a file system without locks is warned of and used") {
  const TemporaryDirectory folder;
  for (const int reason : {ENOSYS, EOPNOTSUPP, ENOLCK, EINVAL}) {
    CAPTURE(reason);
    const LogCapture log;
    lock_failure = reason;
    const std::string refusal = data_error([&] { FileLock{folder / ".lock"}; });
    lock_failure = 0;
    CHECK(refusal.empty());
    CHECK(log.lines() == 1);
    CHECK(log.contains(folder.path().string() + " is on a file system without locks"));
    CHECK(log.contains("would not notice each other"));
  }
  lock_failure = EIO;
  const std::string refusal = data_error([&] { FileLock{folder / ".lock"}; });
  lock_failure = 0;
  CHECK(contains(refusal, folder.path().string() + " cannot be locked"));
}
