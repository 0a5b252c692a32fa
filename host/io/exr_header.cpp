// SPDX-License-Identifier: Apache-2.0
#include "io/exr_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{1} << 24;
constexpr std::size_t kMaxName = 256;
constexpr std::uint32_t kMultiPart = 0x1000;

constexpr std::uint64_t kChunkOffsetBytes = 8;

constexpr std::size_t kChannelBytes = 16;

struct FixedType {
  std::string_view name;
  std::size_t bytes;
};
constexpr std::array<FixedType, 24> kFixedTypes{{{"box2i", 16},
                                                 {"box2f", 16},
                                                 {"chromaticities", 32},
                                                 {"compression", 1},
                                                 {"deepImageState", 1},
                                                 {"double", 8},
                                                 {"envmap", 1},
                                                 {"float", 4},
                                                 {"int", 4},
                                                 {"keycode", 28},
                                                 {"lineOrder", 1},
                                                 {"m33d", 72},
                                                 {"m33f", 36},
                                                 {"m44d", 128},
                                                 {"m44f", 64},
                                                 {"rational", 8},
                                                 {"tiledesc", 9},
                                                 {"timecode", 8},
                                                 {"v2d", 16},
                                                 {"v2f", 8},
                                                 {"v2i", 8},
                                                 {"v3d", 24},
                                                 {"v3f", 12},
                                                 {"v3i", 12}}};

struct Start {
  std::vector<std::byte> bytes;  // as much as a header may have
  std::uint64_t file_bytes = 0;
};

Start read_start(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary | std::ios::ate);
  const std::streamoff size = stream ? static_cast<std::streamoff>(stream.tellg()) : -1;
  if (size < 0) throw DataError(fmt::format("The image {} cannot be read", path.string()));
  Start start;
  start.file_bytes = static_cast<std::uint64_t>(size);
  start.bytes.resize(std::min(static_cast<std::size_t>(size), kMaxHeaderBytes));
  stream.seekg(0);
  stream.read(reinterpret_cast<char*>(start.bytes.data()),
              static_cast<std::streamsize>(start.bytes.size()));
  if (!stream) throw DataError(fmt::format("The image {} cannot be read", path.string()));
  return start;
}

/// One part of the file: its header, and what that makes OpenEXR ask for.
class Part {
 public:
  Part(ByteReader& reader, std::uint64_t file_bytes, int max_side)
      : reader_(reader), file_bytes_(file_bytes), max_side_(max_side) {}

  /// False when there is no attribute: the end of a list of headers.
  bool check() {
    std::size_t attributes = 0;
    for (;; ++attributes) {
      const std::string name = reader_.zero_terminated("the name of an attribute", kMaxName);
      if (name.empty()) break;
      check_attribute(name);
    }
    const std::uint64_t across = (sides_[0] + tile_[0] - 1) / tile_[0];
    const std::uint64_t down = (sides_[1] + tile_[1] - 1) / tile_[1];
    if (tiled_) check_chunks(across * down);
    return attributes > 0;
  }

 private:
  // OpenEXR reads an attribute by its type, not by its size: where they differ, it takes what
  // follows for the next attribute.
  void check_attribute(const std::string& name) {
    const std::string type = reader_.zero_terminated("the type of an attribute", kMaxName);
    const auto size = reader_.read<std::int32_t>("the size of an attribute");
    if (size < 0 || static_cast<std::size_t>(size) > reader_.remaining()) {
      reader_.fail(fmt::format("the attribute '{}' is longer than the header", name));
    }
    const auto bytes = static_cast<std::size_t>(size);
    const std::size_t end = reader_.offset() + bytes;
    const auto fixed =
        std::find_if(kFixedTypes.begin(), kFixedTypes.end(),
                     [&](const FixedType& candidate) { return type == candidate.name; });
    if (fixed != kFixedTypes.end() && fixed->bytes != bytes) {
      reader_.fail(
          fmt::format("the attribute '{}' has {} bytes, its type {}", name, bytes, fixed->bytes));
    }
    if (type == "chlist") {
      while (!reader_.zero_terminated("the name of a channel", kMaxName).empty()) {
        reader_.skip(kChannelBytes, "a channel");
      }
    } else if (type == "stringvector") {
      while (reader_.offset() < end) {
        reader_.skip(reader_.read<std::uint32_t>("the length of a text"), "a text");
      }
    } else if (type == "preview") {
      const std::uint64_t width = reader_.read<std::uint32_t>("the size of a preview");
      const std::uint64_t height = reader_.read<std::uint32_t>("the size of a preview");
      reader_.skip(saturating_product(4, width * height), "a preview");
    } else if ((name == "dataWindow" || name == "displayWindow") && type == "box2i") {
      check_window(name == "dataWindow");
    } else if (name == "chunkCount" && type == "int") {
      check_chunks(reader_.read<std::uint32_t>("the count of chunks"));
    } else if (type == "tiledesc") {
      check_tiles();
    } else {
      reader_.skip(bytes, "an attribute");
    }
    if (reader_.offset() != end) {
      reader_.fail(fmt::format("the attribute '{}' has another size than it says", name));
    }
  }

  void check_tiles() {
    tiled_ = true;
    for (std::uint64_t& side : tile_) {
      side = reader_.read<std::uint32_t>("the size of a tile");
      if (side < 1 || side > static_cast<std::uint64_t>(max_side_)) {
        reader_.fail(fmt::format("a tile has a side of {} pixels", side));
      }
    }
    reader_.skip(1, "the levels of tiles");
  }

  // A box of whole numbers: its corners belong to it.
  void check_window(bool data) {
    std::int64_t corner[4];
    for (std::int64_t& value : corner) {
      value = reader_.read<std::int32_t>("a window of the picture");
    }
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const std::int64_t side = corner[2 + axis] - corner[axis] + 1;
      if (side < 1 || side > max_side_) {
        reader_.fail(fmt::format("a window of the picture has a side of {} pixels", side));
      }
      if (data) sides_[axis] = static_cast<std::uint64_t>(side);
    }
  }

  // A table in the file says where every chunk begins.
  void check_chunks(std::uint64_t count) const {
    if (count > file_bytes_ / kChunkOffsetBytes) {
      reader_.fail(
          fmt::format("{} chunks are more than the file of {} bytes can hold", count, file_bytes_));
    }
  }

  ByteReader& reader_;
  std::uint64_t file_bytes_;
  int max_side_;
  bool tiled_ = false;
  std::array<std::uint64_t, 2> sides_{};
  std::array<std::uint64_t, 2> tile_{1, 1};
};

}  // namespace

void check_exr_header(const std::filesystem::path& path, int max_side) {
  const Start start = read_start(path);
  ByteReader reader(start.bytes, path);
  reader.skip(4, "the signature");
  const bool parts = (reader.read<std::uint32_t>("the version") & kMultiPart) != 0;
  // An empty header ends the list of a file with several parts.
  while (Part(reader, start.file_bytes, max_side).check() && parts) {
  }
}

}  // namespace raysplats::io
