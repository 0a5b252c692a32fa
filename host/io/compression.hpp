// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

/// gzip (zlib) and zstd over bytes in memory. Sizes of what comes out are known before, so that a
/// small file cannot ask for much memory.
namespace raysplats::io {

/// Inflates a gzip stream step by step, all members of it (RFC 1952) as one.
class GzipReader {
 public:
  GzipReader(std::span<const std::byte> bytes, const std::filesystem::path& path);
  ~GzipReader();
  GzipReader(const GzipReader&) = delete;
  GzipReader& operator=(const GzipReader&) = delete;
  /// Fills `out`. Throws DataError for damaged streams and those that end before.
  void read(std::span<std::byte> out);
  /// The rest of the stream, at most `limit` bytes, whose checksum is then right. Throws DataError
  /// for damage, missing bytes and for more than that.
  std::vector<std::byte> finish(std::size_t limit);

 private:
  struct State;
  /// Returns how many bytes were written; fewer than asked for at the end of the stream.
  std::size_t inflate_some(std::span<std::byte> out);
  [[noreturn]] void fail(const char* what) const;
  State* state_;
  std::filesystem::path path_;
  std::span<const std::byte> left_;
  bool ended_ = false;
};

/// One gzip stream that holds all parts one after the other.
std::vector<std::byte> gzip(std::span<const std::span<const std::byte>> parts);

/// Decodes one zstd frame of exactly out.size() bytes. Throws DataError.
void unzstd(std::span<const std::byte> frame,
            std::span<std::byte> out,
            const std::filesystem::path& path);
std::vector<std::byte> zstd(std::span<const std::byte> bytes);

}  // namespace raysplats::io
