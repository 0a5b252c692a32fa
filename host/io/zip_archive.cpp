// SPDX-License-Identifier: Apache-2.0
// Layout: PKWARE's APPNOTE.TXT 6.3, sections 4.3.7, 4.3.12 and 4.3.16.
#include "io/zip_archive.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <cstring>
#include <limits>
#include <new>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::uint32_t kLocalHeader = 0x04034b50;
constexpr std::uint32_t kCentralHeader = 0x02014b50;
constexpr std::uint32_t kEnd = 0x06054b50;
constexpr std::size_t kEndBytes = 22;
constexpr std::size_t kMostComment = 65535;
constexpr std::size_t kLocalBytes = 30;
constexpr std::uint16_t kEncrypted = 1;
constexpr std::uint16_t kStored = 0;
constexpr std::uint16_t kDeflated = 8;
constexpr std::uint16_t kVersion = 20;  // of the format, 2.0
/// What all files may inflate to: pictures do not shrink, and a text of some kilobytes does so
/// tenfold.
constexpr std::uint64_t kMostGrowth = 4;
constexpr std::uint64_t kGrowthSlack = std::uint64_t{1} << 20;
/// 1 January 1980: equal models make equal files.
constexpr std::uint16_t kDate = 1 << 5 | 1;

std::uint32_t checksum_of(std::span<const std::byte> bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

/// Where the record at the end begins: the last place that looks like it and whose comment ends
/// with the file.
std::size_t end_record(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  const std::size_t from =
      bytes.size() > kEndBytes + kMostComment ? bytes.size() - kEndBytes - kMostComment : 0;
  for (std::size_t at = bytes.size(); at-- > from;) {
    if (bytes.size() - at < kEndBytes) continue;
    ByteReader reader(bytes.subspan(at), path);
    if (reader.read<std::uint32_t>("a signature") != kEnd) continue;
    reader.skip(16, "the end of the archive");
    if (reader.read<std::uint16_t>("a length") == bytes.size() - at - kEndBytes) return at;
  }
  throw DataError(fmt::format("{} is no zip archive, or its end is missing", path.string()));
}

template <class T>
void put(std::vector<std::byte>& to, T value) {
  const auto* bytes = reinterpret_cast<const std::byte*>(&value);
  to.insert(to.end(), bytes, bytes + sizeof(T));
}

void put_text(std::vector<std::byte>& to, const std::string& text) {
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  to.insert(to.end(), bytes, bytes + text.size());
}

}  // namespace

ZipArchive::ZipArchive(std::span<const std::byte> bytes, const std::filesystem::path& path)
    : bytes_(bytes), path_(path) {
  ByteReader end(bytes.subspan(end_record(bytes, path)), path);
  end.skip(10, "the end of the archive");
  const auto count = end.read<std::uint16_t>("the number of files");
  end.skip(4, "the end of the archive");
  const auto begin = end.read<std::uint32_t>("the place of the central directory");
  ByteReader reader(bytes, path);
  // Numbers that do not fit, and that Zip64 says elsewhere, have all bits set.
  const auto refuse_zip64 = [&] {
    reader.fail("the archive is a Zip64, as for more than 4 GiB, which is not supported");
  };
  if (count == UINT16_MAX || begin == UINT32_MAX) refuse_zip64();
  reader.skip(begin, "the central directory");
  std::uint64_t inflated = 0;
  for (std::uint16_t i = 0; i < count; ++i) {
    if (reader.read<std::uint32_t>("a file of the directory") != kCentralHeader)
      reader.fail("the central directory is damaged");
    Entry entry;
    reader.skip(4, "a version");
    const auto flags = reader.read<std::uint16_t>("the flags of a file");
    entry.method = reader.read<std::uint16_t>("the method of a file");
    reader.skip(4, "the time of a file");
    entry.checksum = reader.read<std::uint32_t>("a checksum");
    entry.packed = reader.read<std::uint32_t>("a size");
    entry.size = reader.read<std::uint32_t>("a size");
    const auto name = reader.read<std::uint16_t>("the length of a name");
    const auto extra = reader.read<std::uint16_t>("a length");
    const auto comment = reader.read<std::uint16_t>("a length");
    reader.skip(8, "the attributes of a file");
    entry.header = reader.read<std::uint32_t>("the place of a file");
    const std::size_t at = reader.offset();
    reader.skip(std::uint64_t{name} + extra + comment, "the name of a file");
    if ((flags & kEncrypted) != 0) reader.fail("a file of the archive is encrypted");
    if (entry.packed == UINT32_MAX || entry.size == UINT32_MAX || entry.header == UINT32_MAX)
      refuse_zip64();
    inflated += entry.size;
    entries_.emplace(std::string(reinterpret_cast<const char*>(bytes.data()) + at, name), entry);
  }
  if (inflated > kMostGrowth * bytes.size() + kGrowthSlack) {
    reader.fail(fmt::format("the files of the archive claim {} bytes, more than its {} can hold",
                            inflated, bytes.size()));
  }
}

std::vector<std::byte> ZipArchive::read(const std::string& name) const {
  const auto fail = [&](const std::string& what) {
    throw DataError(fmt::format("{}: the file '{}' in it {}", path_.string(), name, what));
  };
  const auto found = entries_.find(name);
  if (found == entries_.end()) fail("is missing");
  const Entry& entry = found->second;
  ByteReader reader(bytes_, path_);
  reader.skip(entry.header, "a file of the archive");
  if (reader.read<std::uint32_t>("the head of a file") != kLocalHeader)
    reader.fail("the archive is damaged");
  reader.skip(kLocalBytes - 8, "the head of a file");
  const auto name_bytes = reader.read<std::uint16_t>("the length of a name");
  const auto extra = reader.read<std::uint16_t>("a length");
  reader.skip(std::uint64_t{name_bytes} + extra, "the head of a file");
  const std::size_t begin = reader.offset();
  reader.skip(entry.packed, "a file of the archive");
  const std::span<const std::byte> packed = bytes_.subspan(begin, entry.packed);
  std::vector<std::byte> out;
  if (entry.method == kStored) {
    if (entry.size != entry.packed) fail("has two sizes");
    out.assign(packed.begin(), packed.end());
  } else if (entry.method == kDeflated) {
    out.resize(entry.size);
    z_stream stream{};
    // Without zlib's header, which zip leaves out.
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<std::byte*>(packed.data()));
    stream.avail_in = static_cast<uInt>(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    const int status = inflate(&stream, Z_FINISH);
    const bool whole = status == Z_STREAM_END && stream.avail_out == 0;
    inflateEnd(&stream);
    if (!whole) fail("is damaged");
  } else {
    fail(fmt::format("is packed by method {}, which is not known", entry.method));
  }
  if (checksum_of(out) != entry.checksum) fail("is damaged");
  return out;
}

std::vector<std::string> ZipArchive::names() const {
  std::vector<std::string> names;
  for (const auto& [name, entry] : entries_) names.push_back(name);
  return names;
}

std::vector<std::byte> zip_of(
    const std::vector<std::pair<std::string, std::vector<std::byte>>>& files,
    const std::filesystem::path& path) {
  std::vector<std::byte> out;
  std::vector<std::byte> directory;
  const auto limited = [&](std::size_t bytes) {
    if (bytes >= std::numeric_limits<std::uint32_t>::max()) {
      throw DataError(
          fmt::format("{} cannot be written: it would have more than 4 GiB", path.string()));
    }
    return static_cast<std::uint32_t>(bytes);
  };
  // Version, flags, method, time and date, checksum, sizes, length of the name: in both headers.
  const auto common = [](std::vector<std::byte>& to, const std::string& name,
                         std::uint32_t checksum, std::uint32_t size) {
    for (const std::uint16_t value : {kVersion, std::uint16_t{0}, kStored, std::uint16_t{0}, kDate})
      put(to, value);
    for (const std::uint32_t value : {checksum, size, size}) put(to, value);
    put(to, static_cast<std::uint16_t>(name.size()));
  };
  for (const auto& [name, content] : files) {
    const std::uint32_t header = limited(out.size());
    const std::uint32_t size = limited(content.size());
    const std::uint32_t checksum = checksum_of(content);
    put(out, kLocalHeader);
    common(out, name, checksum, size);
    put(out, std::uint16_t{0});
    put_text(out, name);
    out.insert(out.end(), content.begin(), content.end());
    put(directory, kCentralHeader);
    put(directory, kVersion);
    common(directory, name, checksum, size);
    for (int i = 0; i < 4; ++i) put(directory, std::uint16_t{0});
    put(directory, std::uint32_t{0});
    put(directory, header);
    put_text(directory, name);
  }
  const std::uint32_t begin = limited(out.size());
  out.insert(out.end(), directory.begin(), directory.end());
  limited(out.size());
  put(out, kEnd);
  put(out, std::uint32_t{0});
  for (int i = 0; i < 2; ++i) put(out, static_cast<std::uint16_t>(files.size()));
  put(out, static_cast<std::uint32_t>(directory.size()));
  put(out, begin);
  put(out, std::uint16_t{0});
  return out;
}

}  // namespace raysplats::io
