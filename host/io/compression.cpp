// SPDX-License-Identifier: Apache-2.0
#include "io/compression.hpp"

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

#include "raysplats/error.hpp"
#include "util/stop_if_interrupted.hpp"

namespace raysplats::io {
namespace {

constexpr int kGzipWindow = 15 + 16;  // the largest window, gzip's framing
constexpr int kGzipMemory = 8;        // zlib's default
constexpr int kZstdLevel = 12;        // of SPZ's own library
constexpr std::size_t kMostAtOnce = std::numeric_limits<uInt>::max();

bool begins_member(std::span<const std::byte> bytes) {
  return bytes.size() > 1 && bytes[0] == std::byte{0x1f} && bytes[1] == std::byte{0x8b};
}

Bytef* zlib_pointer(const std::byte* bytes) {
  return const_cast<Bytef*>(reinterpret_cast<const Bytef*>(bytes));
}

}  // namespace

struct GzipReader::State {
  z_stream stream{};
};

GzipReader::GzipReader(std::span<const std::byte> bytes, const std::filesystem::path& path)
    : state_(new State), path_(path), left_(bytes) {
  if (inflateInit2(&state_->stream, kGzipWindow) != Z_OK) {
    delete state_;
    throw std::bad_alloc();
  }
}

GzipReader::~GzipReader() {
  inflateEnd(&state_->stream);
  delete state_;
}

void GzipReader::fail(const char* what) const {
  throw DataError(fmt::format("{}: its gzip stream {}", path_.string(), what));
}

std::size_t GzipReader::inflate_some(std::span<std::byte> out) {
  z_stream& stream = state_->stream;
  std::size_t written = 0;
  while (written < out.size() && !ended_) {
    const std::size_t in = std::min(left_.size(), kMostAtOnce);
    const std::size_t room = std::min(out.size() - written, kMostAtOnce);
    stream.next_in = zlib_pointer(left_.data());
    stream.avail_in = static_cast<uInt>(in);
    stream.next_out = zlib_pointer(out.data() + written);
    stream.avail_out = static_cast<uInt>(room);
    const int status = inflate(&stream, Z_NO_FLUSH);
    left_ = left_.subspan(in - stream.avail_in);
    written += room - stream.avail_out;
    if (status == Z_STREAM_END) {
      // Anything else behind a member, such as zeros, is no part of the stream.
      ended_ = !begins_member(left_);
      if (!ended_) inflateReset(&stream);
    } else if (status == Z_BUF_ERROR || (status == Z_OK && left_.empty() && stream.avail_out > 0)) {
      fail("is truncated");
    } else if (status != Z_OK) {
      fail("is damaged");
    }
  }
  return written;
}

void GzipReader::read(std::span<std::byte> out) {
  if (inflate_some(out) < out.size()) fail("holds less than its header says");
}

std::vector<std::byte> GzipReader::finish(std::size_t limit) {
  std::vector<std::byte> rest;
  std::array<std::byte, 4096> scratch;
  while (!ended_) {
    const auto read = static_cast<std::ptrdiff_t>(inflate_some(scratch));
    rest.insert(rest.end(), scratch.begin(), scratch.begin() + read);
    if (rest.size() > limit) fail("holds more than its header says");
  }
  return rest;
}

std::vector<std::byte> gzip(std::span<const std::span<const std::byte>> parts) {
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kGzipWindow, kGzipMemory,
                   Z_DEFAULT_STRATEGY) != Z_OK) {
    throw std::bad_alloc();
  }
  const std::unique_ptr<z_stream, decltype(&deflateEnd)> end(&stream, deflateEnd);
  std::vector<std::byte> out;
  std::array<std::byte, 1 << 16> scratch;
  const auto run = [&](int flush) {
    int status = Z_OK;
    do {
      stop_if_interrupted();
      stream.next_out = zlib_pointer(scratch.data());
      stream.avail_out = static_cast<uInt>(scratch.size());
      status = deflate(&stream, flush);
      out.insert(out.end(), scratch.begin(),
                 scratch.end() - static_cast<std::ptrdiff_t>(stream.avail_out));
    } while (flush == Z_FINISH ? status != Z_STREAM_END : stream.avail_out == 0);
  };
  for (std::span<const std::byte> part : parts) {
    while (!part.empty()) {
      const std::size_t in = std::min(part.size(), kMostAtOnce);
      stream.next_in = zlib_pointer(part.data());
      stream.avail_in = static_cast<uInt>(in);
      run(Z_NO_FLUSH);
      part = part.subspan(in);
    }
  }
  stream.avail_in = 0;
  run(Z_FINISH);
  return out;
}

void unzstd(std::span<const std::byte> frame,
            std::span<std::byte> out,
            const std::filesystem::path& path) {
  const std::size_t size = ZSTD_decompress(out.data(), out.size(), frame.data(), frame.size());
  if (ZSTD_isError(size) != 0u || size != out.size()) {
    throw DataError(fmt::format(
        "{}: a zstd stream is damaged or has another size than its header says", path.string()));
  }
}

std::vector<std::byte> zstd(std::span<const std::byte> bytes) {
  std::vector<std::byte> out(ZSTD_compressBound(bytes.size()));
  const std::size_t size =
      ZSTD_compress(out.data(), out.size(), bytes.data(), bytes.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0u) throw std::bad_alloc();
  out.resize(size);
  return out;
}

}  // namespace raysplats::io
