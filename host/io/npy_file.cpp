// SPDX-License-Identifier: Apache-2.0
#include "io/npy_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cstdint>
#include <glm/gtc/packing.hpp>
#include <limits>
#include <optional>
#include <string_view>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"
#include "util/atomic_file.hpp"

namespace raysplats::io {
namespace {

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::size_t kMostHeader = std::size_t{1} << 16;
constexpr std::size_t kMostDimensions = 64;  // as NumPy 2 has it
constexpr std::size_t kAlignment = 64;       // of the data behind the header

/// What the header's dictionary says.
struct Description {
  std::optional<std::string> type;
  std::optional<bool> fortran;
  std::optional<std::vector<std::size_t>> shape;
};

/// Reads a Python dictionary of a string, a boolean and a tuple of whole numbers: all that a .npy
/// header may hold.
class HeaderParser {
 public:
  explicit HeaderParser(std::string_view text) : text_(text) {}

  /// Nothing when the text is no such dictionary.
  std::optional<Description> parse() {
    Description out;
    if (!take('{')) return std::nullopt;
    while (!take('}')) {
      const std::optional<std::string> key = string();
      if (!key || !take(':') || !value(*key, out)) return std::nullopt;
      if (take(',')) continue;
      if (!take('}')) return std::nullopt;
      break;
    }
    skip_space();
    if (!text_.empty() || !out.type || !out.fortran || !out.shape) return std::nullopt;
    return out;
  }

 private:
  void skip_space() {
    while (!text_.empty() && (text_.front() == ' ' || text_.front() == '\n')) {
      text_.remove_prefix(1);
    }
  }
  bool take(char c) {
    skip_space();
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  bool take(std::string_view word) {
    skip_space();
    if (!text_.starts_with(word)) return false;
    text_.remove_prefix(word.size());
    return true;
  }
  std::optional<std::string> string() {
    skip_space();
    if (text_.empty() || (text_.front() != '\'' && text_.front() != '"')) return std::nullopt;
    const std::size_t end = text_.find(text_.front(), 1);
    if (end == std::string_view::npos) return std::nullopt;
    std::string out(text_.substr(1, end - 1));
    text_.remove_prefix(end + 1);
    return out;
  }
  std::optional<std::vector<std::size_t>> tuple() {
    std::vector<std::size_t> out;
    if (!take('(')) return std::nullopt;
    while (!take(')')) {
      skip_space();
      std::size_t number = 0;
      const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), number);
      if (error != std::errc()) return std::nullopt;
      text_.remove_prefix(static_cast<std::size_t>(end - text_.data()));
      out.push_back(number);
      if (take(',')) continue;
      if (!take(')')) return std::nullopt;
      break;
    }
    return out;
  }
  bool value(const std::string& key, Description& out) {
    if (key == "descr") return (out.type = string()).has_value();
    if (key == "shape") return (out.shape = tuple()).has_value();
    if (key != "fortran_order") return false;
    if (take("True")) return (out.fortran = true).has_value();
    return take("False") && (out.fortran = false).has_value();
  }

  std::string_view text_;
};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& what) {
  throw DataError(fmt::format("{} {}", path.string(), what));
}

/// How the numbers of a file are stored.
struct NumberType {
  bool big_endian = false;
  char kind = 'f';        ///< NumPy's: f, i or u
  std::size_t bytes = 4;  ///< 2, 4 or 8, and 1 of whole numbers
};

NumberType number_type(const std::filesystem::path& path, const std::string& name) {
  static constexpr std::array<std::string_view, 11> kKnown{"f2", "f4", "f8", "i1", "i2", "i4",
                                                           "i8", "u1", "u2", "u4", "u8"};
  const std::string_view type =
      std::string_view(name).substr(std::min<std::size_t>(1, name.size()));
  const bool ordered = name.starts_with('<') || name.starts_with('>') || type.ends_with('1');
  if (!ordered || std::find(kKnown.begin(), kKnown.end(), type) == kKnown.end()) {
    fail(path, fmt::format("holds numbers of the type '{}', neither floats of 2 to 8 bytes nor "
                           "whole numbers: save array.astype('<f4')",
                           name));
  }
  return {name.front() == '>', type[0], static_cast<std::size_t>(type[1] - '0')};
}

/// The number of these bytes, the lowest first.
template <class T>
T to_number(std::uint64_t bits, const NumberType& type) {
  if (type.kind == 'u') return static_cast<T>(bits);
  if (type.kind == 'i') {
    const auto unused = static_cast<int>(64 - 8 * type.bytes);
    return static_cast<T>(static_cast<std::int64_t>(bits << unused) >> unused);
  }
  if (type.bytes == 2) return glm::unpackHalf1x16(static_cast<std::uint16_t>(bits));
  if (type.bytes == 4) return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
  return static_cast<T>(std::bit_cast<double>(bits));
}

template <class T>
std::vector<T> numbers_of(std::span<const std::byte> bytes, const NumberType& type) {
  std::vector<T> out(bytes.size() / type.bytes);
  for (std::size_t i = 0; i < out.size(); ++i) {
    std::uint64_t bits = 0;
    for (std::size_t k = 0; k < type.bytes; ++k) {
      const std::size_t place = type.big_endian ? type.bytes - 1 - k : k;
      bits |= std::to_integer<std::uint64_t>(bytes[i * type.bytes + place]) << (8 * k);
    }
    out[i] = to_number<T>(bits, type);
  }
  return out;
}

/// Numbers of which the first index runs fastest, so that the last one does.
template <class T>
std::vector<T> in_c_order(const std::vector<T>& numbers, const std::vector<std::size_t>& shape) {
  std::vector<T> out(numbers.size());
  std::vector<std::size_t> index(shape.size());
  for (T& value : out) {
    std::size_t place = 0;
    for (std::size_t axis = shape.size(); axis-- > 0;) place = place * shape[axis] + index[axis];
    value = numbers[place];
    for (std::size_t axis = shape.size(); axis-- > 0 && ++index[axis] == shape[axis];)
      index[axis] = 0;
  }
  return out;
}

std::string header_of(const NpzMember& member) {
  std::string shape;
  for (const std::size_t size : member.shape) shape += fmt::format("{}, ", size);
  if (member.shape.size() > 1) shape.resize(shape.size() - 2);
  if (member.shape.size() == 1) shape.resize(shape.size() - 1);
  std::string text =
      fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}), }}", member.type, shape);
  constexpr std::size_t before = kMagic.size() + 4;
  text.resize((before + text.size() + 1 + kAlignment - 1) / kAlignment * kAlignment - before - 1,
              ' ');
  text += '\n';
  std::string out(kMagic);
  out +=
      {'\x01', '\x00', static_cast<char>(text.size() & 0xff), static_cast<char>(text.size() >> 8)};
  return out + text;
}

/// Little-endian fields of a zip archive.
class Record {
 public:
  Record& u16(std::size_t value) { return add(value, 2); }
  Record& u32(std::size_t value) { return add(value, 4); }
  Record& text(std::string_view value) {
    bytes_ += value;
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  Record& add(std::size_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) bytes_ += static_cast<char>(value >> (8 * i) & 0xff);
    return *this;
  }
  std::string bytes_;
};

std::size_t checksum(const std::string& header, std::span<const std::byte> data) {
  uLong crc = crc32_z(0, reinterpret_cast<const Bytef*>(header.data()), header.size());
  // Of no data at no address the sum would begin anew.
  if (!data.empty()) crc = crc32_z(crc, reinterpret_cast<const Bytef*>(data.data()), data.size());
  return crc;
}

template <class T>
NpyNumbers<T> read_numbers(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_file(path);
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  if (!text.starts_with(kMagic)) fail(path, "is no .npy file: save one with numpy.save()");
  ByteReader reader(bytes, path);
  reader.skip(kMagic.size(), "the magic bytes");
  const auto version = reader.read<std::uint8_t>("the version");
  reader.read<std::uint8_t>("the version");
  if (version < 1 || version > 3) {
    fail(path, fmt::format("is a .npy file of version {}: 1 to 3 are known", version));
  }
  const std::size_t length = version == 1 ? reader.read<std::uint16_t>("the header's length")
                                          : reader.read<std::uint32_t>("the header's length");
  if (length > kMostHeader || length > reader.remaining()) {
    fail(path, "has a .npy header longer than the file or 64 KiB: it is damaged, save it again");
  }
  const std::optional<Description> description =
      HeaderParser(text.substr(reader.offset(), length)).parse();
  if (!description) fail(path, "has a damaged .npy header: save it again with numpy.save()");
  reader.skip(length, "the header");
  const NumberType type = number_type(path, *description->type);
  NpyNumbers<T> out;
  out.shape = *description->shape;
  if (out.shape.size() > kMostDimensions) {
    fail(path,
         fmt::format("has {} dimensions, more than NumPy's {}", out.shape.size(), kMostDimensions));
  }
  std::uint64_t count = 1;
  for (const std::size_t size : out.shape) count = saturating_product(count, size);
  if (saturating_product(count, type.bytes) != reader.remaining()) {
    fail(path, fmt::format("has {} bytes of numbers where its shape ({}) needs {} of {} bytes: it "
                           "is damaged, save it again",
                           reader.remaining(), fmt::join(out.shape, ", "), count, type.bytes));
  }
  out.data = numbers_of<T>(std::span(bytes).subspan(reader.offset()), type);
  if (*description->fortran) out.data = in_c_order(out.data, out.shape);
  return out;
}

}  // namespace

NpyArray read_npy(const std::filesystem::path& path) { return read_numbers<float>(path); }

NpyNumbers<double> read_npy_doubles(const std::filesystem::path& path) {
  return read_numbers<double>(path);
}

void write_npz(const std::filesystem::path& path, std::span<const NpzMember> members) {
  std::vector<std::string> headers;
  std::uint64_t total = 0;
  for (const NpzMember& member : members) {
    headers.push_back(header_of(member));
    total += headers.back().size() + member.data.size() + 256;
  }
  if (total > std::numeric_limits<std::uint32_t>::max()) {
    throw DataError(
        fmt::format("{} would have {:.1f} GiB, more than an .npz file of 4 GiB can hold: trace the "
                    "rays in parts",
                    path.string(), static_cast<double>(total) / (1 << 30)));
  }
  // The zip format (PKWARE APPNOTE, 4.3): local headers with the files, then the directory.
  constexpr std::size_t kVersion = 20, kDate = 0x21;  // the first of January 1980
  AtomicFile file(path);
  Record directory;
  std::size_t offset = 0;
  for (std::size_t i = 0; i < members.size(); ++i) {
    const NpzMember& member = members[i];
    const std::string name = member.name + ".npy";
    const std::size_t bytes = headers[i].size() + member.data.size();
    const auto described = [&](Record& record) -> Record& {
      return record.u16(0)
          .u16(0)
          .u16(0)
          .u16(kDate)
          .u32(checksum(headers[i], member.data))
          .u32(bytes)
          .u32(bytes)
          .u16(name.size())
          .u16(0);
    };
    Record local;
    local.text("PK\x03\x04").u16(kVersion);
    described(local).text(name);
    directory.text("PK\x01\x02").u16(kVersion).u16(kVersion);
    described(directory).u16(0).u16(0).u16(0).u32(0).u32(offset).text(name);
    file.write(local.bytes());
    file.write(headers[i]);
    file.write(member.data.data(), member.data.size());
    offset += local.bytes().size() + bytes;
  }
  file.write(directory.bytes());
  Record end;
  end.text(std::string_view("PK\x05\x06", 4))
      .u16(0)
      .u16(0)
      .u16(members.size())
      .u16(members.size())
      .u32(directory.bytes().size())
      .u32(offset)
      .u16(0);
  file.write(end.bytes());
  file.commit();
}

}  // namespace raysplats::io
