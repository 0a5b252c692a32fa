// SPDX-License-Identifier: Apache-2.0
#include "io/byte_reader.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <fstream>

#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {

std::vector<std::byte> read_file(const std::filesystem::path& path, std::uint64_t limit) {
  if (!is_there(path)) {
    throw DataError(fmt::format("{} does not exist: check the path", path.string()));
  }
  if (!is_file(path)) {
    throw DataError(fmt::format("{} is not a file: give the path of a file", path.string()));
  }
  std::error_code error;
  const std::uintmax_t size = std::filesystem::file_size(path, error);
  if (error) throw DataError(fmt::format("{} cannot be read: {}", path.string(), error.message()));
  if (size > limit) {
    throw DataError(fmt::format("{} has {} bytes, more than the {} that such a file may have",
                                path.string(), size, limit));
  }
  errno = 0;
  std::ifstream stream(path, std::ios::binary);
  std::vector<std::byte> bytes(static_cast<std::size_t>(size));
  if (stream) {
    stream.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  }
  if (!stream || static_cast<std::uintmax_t>(stream.gcount()) != size) {
    throw DataError(fmt::format("{} cannot be read: {}", path.string(),
                                errno != 0 ? std::strerror(errno) : "it ended early"));
  }
  return bytes;
}

void ByteReader::fail(const std::string& message) const {
  throw DataError(fmt::format("{}: {} at byte {}", path_.string(), message, offset_));
}

void ByteReader::truncated(const char* what) const {
  fail(fmt::format("the file is truncated, {} is missing", what));
}

std::uint64_t ByteReader::count(const char* what, std::uint64_t bytes_each) {
  const auto value = read<std::uint64_t>(what);
  if (saturating_product(value, bytes_each) > remaining()) {
    fail(fmt::format("the {} of {} is more than the remaining {} bytes can hold", what, value,
                     remaining()));
  }
  return value;
}

void ByteReader::skip(std::uint64_t bytes, const char* what) {
  if (bytes > remaining()) truncated(what);
  offset_ += static_cast<std::size_t>(bytes);
}

std::string ByteReader::zero_terminated(const char* what, std::size_t limit) {
  const auto begin = bytes_.begin() + static_cast<std::ptrdiff_t>(offset_);
  const auto last = begin + static_cast<std::ptrdiff_t>(std::min(remaining(), limit));
  const auto end = std::find(begin, last, std::byte{0});
  if (end == last) fail(fmt::format("{} has no end", what));
  std::string text(reinterpret_cast<const char*>(&*begin), static_cast<std::size_t>(end - begin));
  offset_ += text.size() + 1;
  return text;
}

}  // namespace raysplats::io
