// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string_view>
#include <vector>

namespace raysplats {

/// A file that appears whole or not at all: everything goes to a temporary name in the same folder,
/// commit() syncs and renames it over the target. Without commit() the temporary file is removed
/// and the target keeps its old content. Where the target is a link, the file that it leads to is
/// written. A file that is replaced leaves its permissions to the new one. Failures throw DataError
/// with the path and the system's reason (disk full, permissions), devices, pipes and folders too.
class AtomicFile {
 public:
  explicit AtomicFile(std::filesystem::path target);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Path to write to, for libraries that open files themselves; it keeps the target's extension,
  /// or its first 64 bytes.
  const std::filesystem::path& temporary() const { return temporary_; }
  void write(const void* data, std::size_t bytes);
  void write(std::string_view text) { write(text.data(), text.size()); }
  /// Replaces what was written from byte `offset` on; write() goes on behind the last of its own.
  void write_at(std::uint64_t offset, const void* data, std::size_t bytes);
  void commit();

 private:
  void fail(const char* action) const;
  std::filesystem::path target_;
  std::filesystem::path temporary_;
  std::vector<std::filesystem::path> synced_folders_;  // by commit(): the target's and new ones
  std::optional<unsigned> mode_;                       // of the file that is replaced
  int descriptor_ = -1;
  bool committed_ = false;
};

/// Refuses a file to write that somebody has named, before what it is for is computed: UsageError
/// where it is one of `inputs`, which are read, or is there already without `overwrite`; DataError
/// where AtomicFile could not take its place.
void check_output_file(const std::filesystem::path& path,
                       bool overwrite,
                       std::initializer_list<std::filesystem::path> inputs = {});

/// Removes the temporary files that processes which were killed left in `folder` and below, and
/// none that an AtomicFile of any process still holds. Returns how many there were.
std::size_t remove_stale_temporaries(const std::filesystem::path& folder);

/// Writes a whole text file atomically.
void write_text_file(const std::filesystem::path& path, std::string_view text);

}  // namespace raysplats
