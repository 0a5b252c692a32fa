// SPDX-License-Identifier: Apache-2.0
#include "util/atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <random>
#include <string>
#include <utility>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// The name of a file is durable only once its folder is synced; a folder that cannot be opened is
// no error.
void sync_folder(const std::filesystem::path& folder) {
  const int directory = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (directory < 0) return;
  ::fsync(directory);
  ::close(directory);
}

// What fsync() fails with where the file system does not know it, which is no fault of the file.
bool means_no_sync(int reason) {
  return reason == EINVAL || reason == ENOSYS || reason == EOPNOTSUPP;
}

// .NAME.NUMBER.tmp or .NAME.NUMBER.tmp.EXTENSION, as AtomicFile makes them.
bool is_temporary_name(const std::string& name) {
  const std::size_t mark = name.rfind(".tmp");
  if (mark == std::string::npos || name.front() != '.') return false;
  if (mark + 4 != name.size() && name[mark + 4] != '.') return false;
  const std::size_t dot = name.rfind('.', mark - 1);
  if (dot == std::string::npos || dot == 0 || dot + 1 == mark) return false;
  return name.find_first_not_of("0123456789", dot + 1) == mark;
}

// Removes a temporary file that no AtomicFile holds. Whether one does, only a lock can tell.
bool removed_unheld(const std::filesystem::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW);
  if (descriptor < 0) return false;
  const bool removed = ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 && ::unlink(path.c_str()) == 0;
  ::close(descriptor);
  return removed;
}

// A part of a temporary name. Of whole parts it would be longer than the target's name, which may
// be as long as the file system takes. Characters of UTF-8 stay whole: bytes within one have the
// bits 10 first.
std::string shortened(const std::string& part) {
  constexpr std::size_t kMost = 64;
  if (part.size() <= kMost) return part;
  std::size_t end = kMost;
  while (end > 0 && (static_cast<unsigned char>(part[end]) & 0xc0) == 0x80) --end;
  return part.substr(0, end);
}

// What a link leads to, so that the link stays. A device or pipe would become a plain file, and a
// folder stays where it is: better said before anything is computed.
std::filesystem::path real_target(std::filesystem::path target) {
  constexpr int kMostLinks = 16;  // one after the other; a ring of them is no file
  std::error_code error;
  for (int i = 0; i < kMostLinks && std::filesystem::is_symlink(target, error); ++i)
    target = target.parent_path() / std::filesystem::read_symlink(target, error);
  const std::filesystem::file_status status = std::filesystem::status(target, error);
  if (std::filesystem::is_other(status)) {
    throw DataError(
        fmt::format("{} is a device or a pipe: give the name of a file", target.string()));
  }
  if (std::filesystem::is_directory(status))
    throw DataError(fmt::format("{} is a folder: give the name of a file", target.string()));
  if (!target.has_filename())
    throw DataError(fmt::format("'{}' names no file: give the name of one", target.string()));
  return target;
}

}  // namespace

AtomicFile::AtomicFile(std::filesystem::path target) : target_(real_target(std::move(target))) {
  const std::filesystem::path folder = target_.has_parent_path() ? target_.parent_path() : ".";
  std::error_code error;
  for (std::filesystem::path above = folder;
       !above.empty() && above.has_relative_path() && !std::filesystem::exists(above, error);) {
    above = above.has_parent_path() ? above.parent_path() : ".";
    synced_folders_.push_back(above);
  }
  synced_folders_.insert(synced_folders_.begin(), folder);
  std::filesystem::create_directories(folder, error);
  if (error) {
    errno = error.value();
    fail("be created");
  }
  struct stat replaced {};
  if (::stat(target_.c_str(), &replaced) == 0) mode_ = replaced.st_mode & 0777;
  // By chance: processes on several machines that share the folder may have one number.
  std::random_device chance;
  do {
    temporary_ = folder / fmt::format(".{}.{}.tmp{}", shortened(target_.stem().string()), chance(),
                                      shortened(target_.extension().string()));
    // Readable by nobody who may not read what it replaces; libraries may open it anew to write.
    descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC,
                         mode_ ? *mode_ | S_IRUSR | S_IWUSR : 0666);
  } while (descriptor_ < 0 && errno == EEXIST);
  if (descriptor_ < 0) fail("be created");
  // Without waiting and whatever comes of it: it keeps the file from remove_stale_temporaries(),
  // which needs the lock itself.
  ::flock(descriptor_, LOCK_EX | LOCK_NB);
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!committed_) ::unlink(temporary_.c_str());
}

void AtomicFile::fail(const char* action) const {
  throw DataError(fmt::format("{} cannot {}: {}", target_.string(), action, std::strerror(errno)));
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  const char* next = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::write(descriptor_, next, bytes);
    if (written < 0) {
      if (errno == EINTR) continue;
      fail("be written");
    }
    next += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

void AtomicFile::write_at(std::uint64_t offset, const void* data, std::size_t bytes) {
  const char* next = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::pwrite(descriptor_, next, bytes, static_cast<off_t>(offset));
    if (written < 0) {
      if (errno == EINTR) continue;
      fail("be written");
    }
    next += written;
    offset += static_cast<std::uint64_t>(written);
    bytes -= static_cast<std::size_t>(written);
  }
}

void AtomicFile::commit() {
  // What it has now is no wider, for file systems that cannot change it.
  if (mode_) ::fchmod(descriptor_, *mode_);
  if (::fsync(descriptor_) != 0 && !means_no_sync(errno)) fail("be synced");
  // File systems of networks may tell only now what they could not write. The descriptor itself
  // holds the lock until the file has its name.
  const int copy = ::fcntl(descriptor_, F_DUPFD_CLOEXEC, 0);
  if (copy < 0 || ::close(copy) != 0) fail("be closed");
  if (::rename(temporary_.c_str(), target_.c_str()) != 0) fail("be renamed into place");
  committed_ = true;
  ::close(std::exchange(descriptor_, -1));
  for (const std::filesystem::path& folder : synced_folders_) sync_folder(folder);
}

void check_output_file(const std::filesystem::path& path,
                       bool overwrite,
                       std::initializer_list<std::filesystem::path> inputs) {
  const std::filesystem::path target = real_target(path);
  std::error_code error;
  for (const std::filesystem::path& input : inputs) {
    if (!std::filesystem::equivalent(target, input, error)) continue;
    throw UsageError(fmt::format("{} is what is read: give another file to write", path.string()));
  }
  if (!overwrite && std::filesystem::exists(target, error)) {
    throw UsageError(
        fmt::format("{} is there already: give another name, or --overwrite", path.string()));
  }
}

std::size_t remove_stale_temporaries(const std::filesystem::path& folder) {
  std::error_code error;
  std::vector<std::filesystem::path> stale;
  for (std::filesystem::recursive_directory_iterator entry(folder, error), end;
       !error && entry != end; entry.increment(error)) {
    std::error_code status;
    if (entry->is_regular_file(status) && is_temporary_name(entry->path().filename().string()))
      stale.push_back(entry->path());
  }
  return static_cast<std::size_t>(std::count_if(stale.begin(), stale.end(), removed_unheld));
}

void write_text_file(const std::filesystem::path& path, std::string_view text) {
  AtomicFile file(path);
  file.write(text);
  file.commit();
}

}  // namespace raysplats
