// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace raysplats::io {

/// The files of a zip archive in memory, by its central directory (writers may leave sizes out of
/// the headers in front of the files): stored or deflated, below 4 GiB, not encrypted, all of them
/// together within a few times the archive. Written here because libzip brings OpenSSL to
/// everything that links the library. Functions throw DataError, one sentence with the path.
/// `bytes` have to stay.
class ZipArchive {
 public:
  ZipArchive(std::span<const std::byte> bytes, const std::filesystem::path& path);

  /// Whole content of a file, checked against its checksum.
  std::vector<std::byte> read(const std::string& name) const;
  /// The names of all files, sorted, with their folders.
  std::vector<std::string> names() const;

 private:
  struct Entry {
    std::uint16_t method = 0;
    std::uint32_t checksum = 0;
    std::uint32_t packed = 0, size = 0;  // bytes
    std::uint32_t header = 0;            // where its local header lies
  };
  std::map<std::string, Entry> entries_;
  std::span<const std::byte> bytes_;
  std::filesystem::path path_;
};

/// A zip archive of stored files, in this order. Throws DataError for more than 4 GiB.
std::vector<std::byte> zip_of(
    const std::vector<std::pair<std::string, std::vector<std::byte>>>& files,
    const std::filesystem::path& path);

}  // namespace raysplats::io
