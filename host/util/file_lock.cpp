// SPDX-License-Identifier: Apache-2.0
#include "util/file_lock.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <string>
#include <string_view>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// " (process 123)", or nothing when the file does not say.
std::string holder_of(int descriptor) {
  std::array<char, 32> text{};
  const ssize_t bytes = ::pread(descriptor, text.data(), text.size() - 1, 0);
  const std::string_view written(text.data(),
                                 static_cast<std::size_t>(std::max<ssize_t>(bytes, 0)));
  const std::string_view digits = written.substr(0, written.find_first_not_of("0123456789"));
  return digits.empty() ? "" : fmt::format(" (process {})", digits);
}

// What flock() fails with where nobody can have a lock: file systems of networks and of user space,
// lock services that do not run.
bool means_no_locks(int reason) {
  return reason == ENOSYS || reason == EOPNOTSUPP || reason == ENOLCK || reason == EINVAL;
}

}  // namespace

FileLock::FileLock(const std::filesystem::path& path)
    : descriptor_(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644)) {
  if (descriptor_ < 0) {
    throw DataError(
        fmt::format("The lock {} cannot be made: {}", path.string(), std::strerror(errno)));
  }
  int result = 0;
  do {
    result = ::flock(descriptor_, LOCK_EX | LOCK_NB);
  } while (result != 0 && errno == EINTR);
  const int reason = result != 0 ? errno : 0;
  const std::string folder = path.parent_path().string();
  if (means_no_locks(reason)) {
    spdlog::warn(
        "{} is on a file system without locks ({}): two runs into it would not notice each other",
        folder, std::strerror(reason));
  } else if (reason != 0) {
    const std::string holder = holder_of(descriptor_);
    ::close(descriptor_);
    if (reason != EWOULDBLOCK)
      throw DataError(fmt::format("{} cannot be locked: {}", folder, std::strerror(reason)));
    throw DataError(fmt::format(
        "The folder {} is in use by another run{}: wait for it or choose another", folder, holder));
  }
  // For whoever is turned away; the lock itself does not depend on it.
  const std::string process = fmt::format("{}\n", ::getpid());
  if (::ftruncate(descriptor_, 0) == 0) {
    [[maybe_unused]] const ssize_t written =
        ::pwrite(descriptor_, process.data(), process.size(), 0);
  }
}

FileLock::~FileLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace raysplats
