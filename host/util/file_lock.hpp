// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <utility>

namespace raysplats {

/// A file that one process at a time holds. The system drops the lock when the process ends,
/// however it ends, so that a file left behind locks nobody out. Where the file system knows no
/// locks nobody is kept out, which a warning says.
class FileLock {
 public:
  /// Makes the file and takes the lock without waiting. Throws DataError that names the file and,
  /// when it is known, the process that holds it.
  explicit FileLock(const std::filesystem::path& path);
  ~FileLock();
  FileLock(FileLock&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
  FileLock& operator=(FileLock&&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace raysplats
