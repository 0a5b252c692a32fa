// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "io/zip_archive.hpp"

namespace raysplats::test {

inline std::vector<std::byte> deflated(std::span<const std::byte> bytes) {
  std::vector<std::byte> out(compressBound(static_cast<uLong>(bytes.size())));
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, -MAX_WBITS, MAX_MEM_LEVEL,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();
  }
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
  out.resize(stream.total_out);
  deflateEnd(&stream);
  if (!whole) throw std::runtime_error("bytes cannot be deflated");
  return out;
}

/// Where a file's record in the central directory keeps its method, checksum and size.
constexpr std::size_t kZipMethod = 10;
constexpr std::size_t kZipChecksum = 16;
constexpr std::size_t kZipSize = 24;

/// A zip archive whose files are deflated, as other writers make them; its directory has a record
/// of kZipRecord bytes and the name for each file, and ends kZipEnd bytes before the archive does.
constexpr std::size_t kZipRecord = 46;
constexpr std::size_t kZipEnd = 22;
inline std::vector<std::byte> deflated_zip(
    const std::vector<std::pair<std::string, std::vector<std::byte>>>& files) {
  std::vector<std::pair<std::string, std::vector<std::byte>>> packed;
  std::size_t directory = kZipEnd;
  for (const auto& [name, bytes] : files) {
    packed.emplace_back(name, deflated(bytes));
    directory += kZipRecord + name.size();
  }
  std::vector<std::byte> zip = io::zip_of(packed, "deflated.zip");
  std::byte* record = zip.data() + zip.size() - directory;
  const auto set = [&](std::size_t at, auto value) {
    std::memcpy(record + at, &value, sizeof(value));
  };
  for (const auto& [name, bytes] : files) {
    set(kZipMethod, std::uint16_t{Z_DEFLATED});
    set(kZipChecksum, static_cast<std::uint32_t>(
                          crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size())));
    set(kZipSize, static_cast<std::uint32_t>(bytes.size()));
    record += kZipRecord + name.size();
  }
  return zip;
}

}  // namespace raysplats::test
