// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/byte_reader.hpp"
#include "io/compression.hpp"
#include "io/model/model_formats.hpp"
#include "io/model/spz_axes.hpp"
#include "io/model/spz_codes.hpp"
#include "raysplats/error.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "util/atomic_file.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kShortHeader = 16;  // of versions 1 to 3
constexpr std::size_t kLongHeader = 32;   // of version 4
/// Bytes of extensions behind the arrays of versions 1 to 3.
constexpr std::size_t kMostExtensions = std::size_t{1} << 20;

/// What a file holds, on its own axes.
struct SpzContent {
  Gaussians model;
  std::optional<std::uint32_t> axes;  ///< as it declares them
};

using Spans = std::array<std::span<const std::byte>, kSpzArrays>;

/// The part of the header that all versions share. The last byte is reserved until version 4 counts
/// its streams there.
SpzHeader read_header(ByteReader& reader, std::uint8_t& last) {
  if (reader.read<std::uint32_t>("the magic number") != kSpzMagic) {
    reader.fail("the content is no SPZ");
  }
  SpzHeader header;
  header.version = reader.read<std::uint32_t>("the version");
  header.points = reader.read<std::uint32_t>("the number of Gaussians");
  header.sh_degree = reader.read<std::uint8_t>("the SH degree");
  header.fractional_bits = reader.read<std::uint8_t>("the fractional bits");
  header.flags = reader.read<std::uint8_t>("the flags");
  last = reader.read<std::uint8_t>("the end of the header");
  return header;
}

/// Cuts `bytes` into the arrays.
Spans split(std::span<const std::byte> bytes, const SpzSizes& sizes) {
  Spans spans;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < kSpzArrays; ++i) {
    spans[i] = bytes.subspan(begin, sizes[i]);
    begin += sizes[i];
  }
  return spans;
}

std::uint64_t total(const SpzSizes& sizes) {
  std::uint64_t sum = 0;
  for (const std::uint64_t size : sizes) sum += size;
  return sum;
}

bool has_extensions(const SpzHeader& header) { return (header.flags & kSpzExtensions) != 0; }

SpzContent read_gzipped(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  GzipReader gzip(bytes, path);
  std::vector<std::byte> raw(kShortHeader);
  gzip.read(raw);
  ByteReader reader(raw, path);
  std::uint8_t reserved = 0;
  const SpzHeader header = read_header(reader, reserved);
  check_spz_header(header, bytes.size(), path);
  if (header.version >= 4) reader.fail("version 4 has no gzip stream");
  const SpzSizes sizes = spz_sizes(header);
  std::vector<std::byte> arrays(total(sizes));
  gzip.read(arrays);
  const std::vector<std::byte> records = gzip.finish(has_extensions(header) ? kMostExtensions : 0);
  return {unpack_spz(header, split(arrays, sizes), path), declared_spz_axes(records, path)};
}

SpzContent read_streams(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  ByteReader reader(bytes, path);
  std::uint8_t streams = 0;
  const SpzHeader header = read_header(reader, streams);
  if (header.version < 4) {
    reader.fail(
        fmt::format("version {} has to be a gzip stream, which this is not: compress the "
                    "file with gzip",
                    header.version));
  }
  check_spz_header(header, bytes.size(), path);
  const auto table = reader.read<std::uint32_t>("the place of the table");
  const SpzSizes sizes = spz_sizes(header);
  const std::size_t needed = kSpzArrays - (header.sh_degree == 0 ? 1 : 0);
  // Empty arrays may have none.
  if (streams != needed && (header.points != 0 || streams != 0)) {
    reader.fail(fmt::format("there are {} streams where {} are needed", streams, needed));
  }
  if (table < kLongHeader) reader.fail(fmt::format("the table lies at byte {}", table));
  reader.skip(table - reader.offset(), "the table");
  const std::span<const std::byte> records = bytes.subspan(kLongHeader, table - kLongHeader);
  SpzSizes packed{};
  for (std::size_t i = 0; i < streams; ++i) {
    packed[i] = reader.read<std::uint64_t>("the size of a stream");
    const auto raw = reader.read<std::uint64_t>("the size of a stream");
    if (raw != sizes[i]) {
      reader.fail(fmt::format("a stream has {} bytes where {} are needed", raw, sizes[i]));
    }
  }
  std::vector<std::byte> arrays(total(sizes));
  std::span<std::byte> out = arrays;
  for (std::size_t i = 0; i < streams; ++i) {
    const std::size_t begin = reader.offset();
    reader.skip(packed[i], "a stream");
    unzstd(bytes.subspan(begin, packed[i]), out.first(sizes[i]), path);
    out = out.subspan(sizes[i]);
  }
  const auto axes = has_extensions(header) ? declared_spz_axes(records, path) : std::nullopt;
  return {unpack_spz(header, split(arrays, sizes), path), axes};
}

template <class T>
void put(std::vector<std::byte>& to, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i) {
    to.push_back(static_cast<std::byte>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xff));
  }
}

std::vector<std::byte> packed_header(const SpzHeader& header, std::uint8_t last) {
  std::vector<std::byte> bytes;
  put(bytes, kSpzMagic);
  put(bytes, header.version);
  put(bytes, header.points);
  put(bytes, header.sh_degree);
  put(bytes, header.fractional_bits);
  put(bytes, header.flags);
  put(bytes, last);
  return bytes;
}

std::uint32_t code_of(SpzAxes axes) { return axes == SpzAxes::kRub ? kSpzRub : kSpzRdf; }

/// Writes a model that is on these axes.
void write_as_it_is(const std::filesystem::path& path,
                    const Gaussians& model,
                    int version,
                    SpzAxes axes) {
  SpzHeader header;
  header.version = static_cast<std::uint32_t>(version);
  const auto arrays = pack_spz(model, header, path);
  AtomicFile file(path);
  const auto write = [&](const std::vector<std::byte>& bytes) {
    file.write(bytes.data(), bytes.size());
  };
  if (version < 4) {
    // Without a record of the axes: readers of that time want no byte behind the arrays.
    const std::vector<std::byte> head = packed_header(header, 0);
    std::vector<std::span<const std::byte>> parts{head};
    for (const auto& array : arrays) parts.emplace_back(array);
    write(gzip(parts));
  } else {
    const std::vector<std::byte> record = spz_axes_record(code_of(axes));
    header.flags = kSpzExtensions;
    const std::size_t streams =
        header.points == 0 ? 0 : kSpzArrays - (header.sh_degree == 0 ? 1 : 0);
    std::vector<std::byte> head = packed_header(header, static_cast<std::uint8_t>(streams));
    put(head, static_cast<std::uint32_t>(kLongHeader + record.size()));
    head.resize(kLongHeader);
    head.insert(head.end(), record.begin(), record.end());
    std::vector<std::vector<std::byte>> frames;
    for (std::size_t i = 0; i < streams; ++i) {
      frames.push_back(zstd(arrays[i]));
      put(head, static_cast<std::uint64_t>(frames.back().size()));
      put(head, static_cast<std::uint64_t>(arrays[i].size()));
    }
    std::uint64_t packed = head.size();
    for (const auto& frame : frames) packed += frame.size();
    write(head);
    for (const auto& frame : frames) write(frame);
    // Equal Gaussians pack to next to nothing, which reading does not take for so many.
    const std::uint64_t least = total(spz_sizes(header)) / kSpzMostShrinking + 1;
    if (header.points > kAlwaysHeld && packed < least)
      write(std::vector<std::byte>(static_cast<std::size_t>(least - packed)));
  }
  file.commit();
}

}  // namespace

Gaussians read_spz(const std::filesystem::path& path, SpzAxes assumed) {
  const std::vector<std::byte> bytes = read_file(path);
  const bool gzipped =
      bytes.size() > 1 && bytes[0] == std::byte{0x1f} && bytes[1] == std::byte{0x8b};
  SpzContent content = gzipped ? read_gzipped(bytes, path) : read_streams(bytes, path);
  const std::uint32_t axes = content.axes.value_or(code_of(assumed));
  if (content.axes && (axes != kSpzRdf || assumed != SpzAxes::kPly)) {
    spdlog::info("{}: its axes are {}, as it declares", path.string(), spz_axes_name(axes));
  } else if (!content.axes && assumed == SpzAxes::kPly) {
    spdlog::info(
        "{} does not declare its axes, which are taken as {}: where it is upside down, raysplats "
        "convert --spz-axes rub writes it as it should be",
        path.string(), spz_axes_name(axes));
  }
  if (axes == kSpzRdf) return std::move(content.model);
  return transformed(std::move(content.model), spz_axes_turn(axes));
}

void write_spz(const std::filesystem::path& path,
               const Gaussians& model,
               int version,
               SpzAxes axes) {
  if (axes == SpzAxes::kPly) return write_as_it_is(path, model, version, axes);
  // Half a turn, which leads both ways.
  write_as_it_is(path, transformed(model, spz_axes_turn(code_of(axes))), version, axes);
}

}  // namespace raysplats::io
