// SPDX-License-Identifier: Apache-2.0
#include "io/exr_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kMaxHeaderBytes = std::size_t{1} << 24;
constexpr std::size_t kMaxName = 256;
constexpr std::uint32_t kMultiPart = 0x1000;

constexpr std::uint64_t kChunkOffsetBytes = 8;

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
  void check_attribute(const std::string& name) {
    reader_.zero_terminated("the type of an attribute", kMaxName);
    const auto size = reader_.read<std::int32_t>("the size of an attribute");
    if (size < 0 || static_cast<std::size_t>(size) > reader_.remaining()) {
      reader_.fail(fmt::format("the attribute '{}' is longer than the header", name));
    }
    if ((name == "dataWindow" || name == "displayWindow") && size == 16) {
      check_window(name == "dataWindow");
    } else if (name == "chunkCount" && size == 4) {
      check_chunks(reader_.read<std::uint32_t>("the count of chunks"));
    } else if (name == "tiles" && size == 9) {
      tiled_ = true;
      for (std::uint64_t& side : tile_) {
        side = reader_.read<std::uint32_t>("the size of a tile");
        if (side < 1 || side > static_cast<std::uint64_t>(max_side_)) {
          reader_.fail(fmt::format("a tile has a side of {} pixels", side));
        }
      }
      reader_.skip(1, "the levels of tiles");
    } else {
      reader_.skip(static_cast<std::uint64_t>(size), "an attribute");
    }
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
