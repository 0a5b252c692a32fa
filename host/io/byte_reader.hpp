// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace raysplats::io {

/// The whole content of a regular file. Throws DataError when it is missing, no file, unreadable or
/// larger than `limit` bytes.
std::vector<std::byte> read_file(const std::filesystem::path& path,
                                 std::uint64_t limit = UINT64_MAX);

/// a * b, or the largest value when that overflows, so that comparisons with a size stay right.
constexpr std::uint64_t saturating_product(std::uint64_t a, std::uint64_t b) {
  return b != 0 && a > UINT64_MAX / b ? UINT64_MAX : a * b;
}

/// Reads numbers from untrusted bytes. Every read and every count is checked against the bytes that
/// are left; failures throw DataError with the file and the byte offset.
class ByteReader {
 public:
  ByteReader(std::span<const std::byte> bytes, const std::filesystem::path& path)
      : bytes_(bytes), path_(path) {}

  std::size_t offset() const { return offset_; }
  std::size_t remaining() const { return bytes_.size() - offset_; }

  /// The next number; `what` names it in the error.
  template <class T>
  T read(const char* what, std::endian order = std::endian::little) {
    static_assert(std::is_arithmetic_v<T>);
    if (remaining() < sizeof(T)) truncated(what);
    std::array<std::byte, sizeof(T)> raw;
    std::memcpy(raw.data(), bytes_.data() + offset_, sizeof(T));
    offset_ += sizeof(T);
    if (order != std::endian::native) std::reverse(raw.begin(), raw.end());
    return std::bit_cast<T>(raw);
  }

  /// A 64-bit little-endian count of items that take at least `bytes_each` bytes of this file each.
  std::uint64_t count(const char* what, std::uint64_t bytes_each);
  void skip(std::uint64_t bytes, const char* what);
  /// Text up to a zero byte, at most `limit` bytes of it.
  std::string zero_terminated(const char* what, std::size_t limit);

  /// Throws DataError: "<path>: <message> at byte <offset>".
  [[noreturn]] void fail(const std::string& message) const;

 private:
  [[noreturn]] void truncated(const char* what) const;
  std::span<const std::byte> bytes_;
  std::filesystem::path path_;
  std::size_t offset_ = 0;
};

}  // namespace raysplats::io
